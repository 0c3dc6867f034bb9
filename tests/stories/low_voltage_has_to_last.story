# A dip of 9.9 s does not trip a timer of 10 s, one of 11 s does. ArduPilot 4.8-dev trips at the same times.
param BATT_LOW_VOLT 10.5
param BATT_CRT_VOLT 9.9
param BATT_FS_LOW_ACT 0
param BATT_FS_CRT_ACT 2
 0.0  voltage 11.1 current 5 arm
 5.0  voltage 10.4
14.9  voltage 11.1
16.0  voltage 10.4
expect 26.1 low
expect 26.1 says Battery 1 is low 10.4
27.0  voltage 11.1            # latched: it does not go away
30.0  voltage 9.8
39.0  voltage 10.2            # the critical timer starts again
41.0  voltage 9.8
expect 51.1 critical
expect 51.1 says Battery 1 is critical 9.
expect 51.2 brake
53.0  voltage 11.1
expect 60.0 brake
end 65
