# No threshold is set: charge states are announced, and nothing else happens. 18 A draw 0.5 % per second.
param BATT_CAPACITY 1000
param BATT_CELLS 3
 0.0  voltage 10.8 current 18 arm
 1.0  reset 20
expect  6.0 turn
expect 14.1 says Battery 1 low: 10.
expect 30.1 says Battery 1 critical: 10.
expect 34.1 says Battery 1 emergency: 10.
expect 39.0 turn
end 40
