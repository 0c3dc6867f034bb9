# A stall takes the voltage below both thresholds within one reading. Critical only warns; low, which is skipped, holds.
param BATT_LOW_TIMER 2
param BATT_LOW_VOLT 10.5
param BATT_CRT_VOLT 10.2
param BATT_FS_LOW_ACT 2
param BATT_FS_CRT_ACT 0
 0.0  voltage 11.4 current 5 arm
expect  2.9 turn
 3.0  voltage 10.0
expect  5.1 critical
expect  5.1 says Battery 1 is critical 10.0
expect  5.2 brake
# The second loss of voltage is none of another level.
 7.0  arm voltage 11.4
10.0  voltage 10.0
expect 14.0 turn
# A battery reset lets both count again.
15.0  reset 50
expect 17.1 critical
expect 17.1 says Battery 1 is critical 10.0
expect 17.2 brake
end 20
