# At the defaults of 15, 7 and 5 % levels are reached while the pack still drives.
param BATT_CAPACITY 100
param BATT_CELLS 2
param BATT_FS_PCT_EN 1
param BATT_FS_LOW_ACT 0
param BATT_FS_CRT_ACT 2
  0.0  pack 100 120 30
  5.0  arm
  6.0  load 0.25 0.05
expect 583.3 says~2 Battery 1 low: *% usable
expect 600.2 low
expect 600.2 says~2 Battery 1 is low
expect 635.4 says~2 Battery 1 critical: *% usable
expect 642.4 critical
expect 642.4 says~2 Battery 1 is critical
expect 642.5 brake
expect 643.4 says~2 Battery 1 emergency: *% usable
end 740
