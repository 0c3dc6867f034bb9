# The same with 3.74 V a cell: 26 %, but 30 are possible.
param BATT_MONITOR 3
param BATT_CELLS 3
param BATT_CAPACITY 1000
param BATT_LOW_MAH 300
param BATT_FS_LOW_ACT 2
 0.0  voltage 11.22
 3.0  arm
expect 9.0 turn
end 10
