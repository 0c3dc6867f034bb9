# BATT_LOW_TIMER 0 disables the voltage thresholds, as in ArduPilot.
param BATT_LOW_TIMER 0
param BATT_LOW_VOLT 10.5
param BATT_CRT_VOLT 9.9
 0.0  voltage 11.1 current 5 arm
 5.0  voltage 9.0
end 20
