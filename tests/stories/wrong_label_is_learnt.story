# The label says 60 mAh, the pack has 48: at the rest after its first drive the board knows, and says so once.
param BATT_CAPACITY 60
param BATT_CELLS 2
param BATT_CRT_VOLT 6.0
  0.0  pack 48 200 100
  5.0  load 2.6 0.8
103.0  load 0 0
expect 102.0 health unknown
expect 133.3 says~1 Battery 1 learnt: 4
expect 135.0 health 83
end 135.5
