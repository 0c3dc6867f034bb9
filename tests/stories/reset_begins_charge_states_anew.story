# After a battery reset a charge state that was announced is news again.
param BATT_CAPACITY 1000
param BATT_CELLS 3
 0.0  voltage 10.2 current 0
expect 3.3 says Battery 1 emergency: 10.20V
 5.0  reset 12
expect 5.1 says Battery 1 low:
10.0  reset 16
16.0  reset 12
expect 16.1 says Battery 1 low:
end 19
