# No threshold is set: charge states are announced, and nothing else happens. 18 A draw 0.5 % per second;
# what is below the voltage at which a drive ends is not usable.
param BATT_CAPACITY 1000
param BATT_CELLS 3
 0.0  voltage 11.1 current 18 arm
 1.0  reset 20
expect  6.0 turn
expect 14.2 says Battery 1 low: 11.
expect 25.3 says Battery 1 critical: 11.
expect 29.3 says Battery 1 emergency: 11.
expect 39.0 turn
end 40
