# Limits of the owner's own; 0 disables a state.
param BATT_CAPACITY 1000
param BATT_CELLS 3
param BATT_LOW_PCT 0
param BATT_CRT_PCT 40
param BATT_EMR_PCT 0
 0.0  voltage 11.1 current 36 arm
 1.0  reset 45
expect  9.1 says~0.5 Battery 1 critical: 11.1
end 15
