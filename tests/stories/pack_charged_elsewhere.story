# From 80 to 98 % while USB keeps the board on.
param BATT_CAPACITY 300
param BATT_CELLS 2
  0.0  pack 300 50 80
expect 40 charge
 45.0  unplug
 60.0  pack 300 50 98
expect 62.3 says~1 Battery 1 estimate restarted
expect 124 charge
end 125
