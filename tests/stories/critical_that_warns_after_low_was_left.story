# Low holds. The driver goes on; critical only warns: what was reached before does not count again.
param BATT_LOW_TIMER 2
param BATT_LOW_VOLT 10.5
param BATT_CRT_VOLT 9.9
param BATT_FS_LOW_ACT 2
param BATT_FS_CRT_ACT 0
 0.0  voltage 11.1 current 5 arm
 3.0  voltage 10.4
expect  5.1 low
expect  5.1 says Battery 1 is low
expect  5.2 brake
 7.0  arm
expect  8.0 turn
10.0  voltage 9.5
expect 12.1 critical
expect 12.1 says Battery 1 is critical
expect 14.0 turn
end 15
