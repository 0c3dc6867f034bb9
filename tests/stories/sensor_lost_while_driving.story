# A sensor lost while driving holds, also when the pack is low already: voltages would be missed.
param BATT_LOW_VOLT 10.5
param BATT_LOW_TIMER 2
param BATT_FS_UNH_ACT 2
 0.0  voltage 10.4 current 5
 0.3  arm
expect  2.4 low
expect  2.4 says Battery 1 is low
 5.0  fail
expect  9.5 turn
expect 10.2 unhealthy
expect 10.2 says Battery 1 is missing, last: 10.
expect 10.5 brake
12.0  work
13.0  arm
expect 14.0 turn
14.0  fail
# It was not healthy for 5 s in between: the same loss.
expect 22.0 turn
23.0  work
30.0  fail
expect 35.2 unhealthy
expect 35.2 says Battery 1 is missing, last: 10.
expect 35.5 brake
end 38
