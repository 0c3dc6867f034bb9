# Terminated; contact lost for two seconds, then the same empty pack: the level stays latched.
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
14.0  voltage 9.7
expect 17.1 says Battery 1 emergency: 9.70V
20.0  arm
expect 21.0 coast
end 22
