# A pack of 60 mAh that has 42 left: after a drive its state of health says so. Unplugged, and a sound one plugged in:
# nothing that was learnt counts for that one.
param BATT_CAPACITY 60
param BATT_CELLS 2
param BATT_CRT_VOLT 6.0
  0.0  pack 42 200 100
  5.0  load 2.6 0.8
 90.0  load 0 0
expect  89.0 health unknown
expect 120.3 says~1 Battery 1 learnt: 4* mAh
expect 122.0 health 72
expect 123.4 says~1 Battery 1 emergency:
125.0  voltage 0.3
128.0  pack 60 200 100
expect 130.1 says Battery 1 swapped
expect 132.0 health unknown
end 133
