# After Terminate the motors coast, whatever follows.
param BATT_LOW_TIMER 2
param BATT_LOW_VOLT 10.5
param BATT_CRT_VOLT 9.9
param BATT_FS_LOW_ACT 2
param BATT_FS_CRT_ACT 5
 0.0  voltage 11.1 current 5 arm
 3.0  voltage 9.5
expect 5.1 critical
expect 5.1 says Battery 1 is critical
expect 5.2 coast
 8.0  arm
expect 10.0 coast
end 12
