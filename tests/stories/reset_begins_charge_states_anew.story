# After a battery reset a charge state that was announced is news again.
param BATT_CAPACITY 1000
param BATT_CELLS 3
 0.0  voltage 10.2 current 0
expect 0.1 says Battery 1 emergency: 10.20V
 1.0  reset 12
expect 1.1 says Battery 1 low:
 6.0  reset 16
12.0  reset 12
expect 12.1 says Battery 1 low:
end 15
