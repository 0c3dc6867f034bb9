# One reading without a pack every nine seconds: the timer continues, and the lost contact is reported once.
param BATT_CRT_VOLT 9.9
param BATT_FS_CRT_ACT 2
 0.0  voltage 11.1 current 5 arm
 5.0  voltage 9.0
 8.0  voltage 0.3
expect 8.0 says Battery 1 not connected
 8.1  voltage 9.0
expect 15.1 critical
expect 15.1 says Battery 1 is critical
expect 15.4 brake
17.0  voltage 0.3
17.1  voltage 9.0
26.0  voltage 0.3
26.1  voltage 9.0
expect 56.1 says Battery 1 connected again
end 58
