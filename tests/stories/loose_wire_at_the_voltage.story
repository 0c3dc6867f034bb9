# The wire that measures the voltage is loose for a minute of a drive: what the load draws is counted on.
param BATT_CAPACITY 300
param BATT_CELLS 2
  0.0  pack 300 50 100
 10.0  arm
 11.0  load 6 3
 31.0  loose
expect 31.0 says Battery 1 not connected
expect 36.0 unhealthy
expect 90 charge
 91.0  fixed
expect 110 charge
end 111
