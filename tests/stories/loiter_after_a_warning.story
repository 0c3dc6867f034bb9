# Low only warns; critical executes Loiter or Hold, which is Hold without a position.
# ArduPilot 4.8-dev never executes action 6 after a warning.
param BATT_LOW_TIMER 2
param BATT_LOW_VOLT 10.5
param BATT_CRT_VOLT 9.9
param BATT_FS_LOW_ACT 0
param BATT_FS_CRT_ACT 6
 0.0  voltage 11.1 current 5 arm
 5.0  voltage 10.2
expect 7.1 low
expect 7.1 says Battery 1 is low
expect 8.0 turn
10.0  voltage 9.5
expect 12.1 critical
expect 12.1 says Battery 1 is critical
expect 12.2 brake
end 15
