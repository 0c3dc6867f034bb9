# Percent of the owner's own that act, once they are passed for the timer by a charge that is certain.
param BATT_CAPACITY 1000
param BATT_CELLS 3
param BATT_FS_PCT_EN 1
param BATT_LOW_TIMER 5
param BATT_LOW_PCT 60
param BATT_CRT_PCT 50
param BATT_FS_LOW_ACT 0
param BATT_FS_CRT_ACT 2
 0.0  voltage 11.4 current 3.6
 1.0  reset 61
 2.0  arm
expect 14.3 says Battery 1 low: 11.40V 60% left
expect 16.3 low
expect 16.3 says Battery 1 is low
expect 93.3 says Battery 1 critical: 11.40V 52% left
expect 95.3 critical
expect 95.3 says Battery 1 is critical
expect 95.4 brake
end 130
