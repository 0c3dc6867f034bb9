# The second pack's action is only Warn, after the first one's Hold: the rover stays in Hold.
param BATT_LOW_TIMER 2
param BATT_LOW_VOLT 10.5
param BATT_FS_LOW_ACT 2
param BATT2_MONITOR 3
param BATT2_VOLT_PIN 28
param BATT2_LOW_TIMER 2
param BATT2_LOW_VOLT 7.0
param BATT2_FS_LOW_ACT 0
 0.0  voltage 11.1 current 5 voltage2 7.8 arm
 3.0  voltage 10.4
expect 5.1 low
expect 5.1 says Battery 1 is low
expect 5.2 brake
 8.0  voltage2 6.8
expect 10.1 low2
expect 10.1 says Battery 2 is low 6.8
expect 11.0 brake
end 12
