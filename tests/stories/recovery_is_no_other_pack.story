# Voltage only. When the load ends the pack recovers by 5 % at once and more later: not a swap.
param BATT_MONITOR 3
param BATT_LOW_TIMER 2
param BATT_CRT_VOLT 9.2
param BATT_FS_CRT_ACT 5
 0.0  voltage 11.1 arm
 3.0  voltage 9.0
expect 5.1 critical
expect 5.1 says Battery 1 is critical
expect 3.9 says Battery 1 fault: deep discharge
expect 5.2 coast
expect 7.0 says Battery 1 emergency: 9.00V
 8.0  voltage 9.5
12.0  voltage 10.0
16.0  arm
expect 17.0 coast
end 18
