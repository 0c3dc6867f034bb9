# Terminated; swapped for an even emptier pack, and back to the first one: the level stays latched.
param BATT_LOW_TIMER 2
param BATT_CRT_VOLT 9.9
param BATT_FS_CRT_ACT 5
 0.0  voltage 11.1 current 5 arm
 3.0  voltage 9.5
expect 5.1 critical
expect 5.1 says Battery 1 is critical
 6.0  voltage 10.2 current 0  # it has recovered, which disproves nothing
12.0  voltage 0.3
14.0  voltage 8.8
expect 16.1 says Battery 1 swapped
20.0  arm
expect 21.0 coast
22.0  voltage 0.3
24.0  voltage 10.2
expect 26.1 says Battery 1 swapped
28.0  arm
expect 29.0 coast
end 30
