# The same without a current sensor.
param BATT_MONITOR 3
param BATT_CAPACITY 100
param BATT_CELLS 2
param BATT_FS_PCT_EN 1
param BATT_FS_LOW_ACT 0
param BATT_FS_CRT_ACT 2
  0.0  pack 100 120 30
  5.0  arm
  6.0  load 0.25 0.05
expect 580.3 says~2 Battery 1 low: *% usable
expect 587.3 low
expect 587.3 says~2 Battery 1 is low
expect 644.4 says~2 Battery 1 critical: *% usable
expect 653.4 says~2 Battery 1 emergency: *% usable
expect 651.4 critical
expect 651.4 says~2 Battery 1 is critical
expect 651.5 brake
end 740
