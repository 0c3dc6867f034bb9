# Terminated; swapped for a full pack. After two seconds at rest the level is cleared, and the rover may drive.
param BATT_LOW_TIMER 2
param BATT_CRT_VOLT 9.9
param BATT_FS_CRT_ACT 5
 0.0  voltage 11.1 current 5 arm
 3.0  voltage 9.5
expect 5.1 critical
expect 5.1 says Battery 1 is critical
expect 5.2 coast
 6.0  voltage 9.7 current 0
12.0  voltage 0.3
14.0  voltage 12.3
15.0  arm                     # it has not rested yet
expect 15.5 coast
expect 16.1 says Battery 1 swapped
18.0  arm
expect 19.0 turn
end 20
