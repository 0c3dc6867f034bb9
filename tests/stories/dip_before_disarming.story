# A dip while armed, 30 s disarmed, and rearmed below the threshold: the timer restarts.
# ArduPilot 4.8-dev trips on the first armed tick.
param BATT_LOW_VOLT 10.5
 0.0  voltage 11.1 current 5 arm
 3.0  voltage 10.4
 5.0  voltage 11.1 disarm
35.0  voltage 10.4
36.0  arm
expect 46.1 low
expect 46.1 says Battery 1 is low
end 50
