# A pack at some 85 % is taken out while USB keeps the board on, and one at 62 % put in: it is estimated by its own voltage.
param BATT_CAPACITY 300
param BATT_CELLS 2
  0.0  pack 300 50 100
 10.0  arm
 11.0  load 6 3
 47.0  load 0 0
 49.0  disarm
expect 65 charge
 70.0  unplug
 80.0  pack 300 50 62
expect 82.3 says~1 Battery 1 estimate restarted
expect 145 charge
150.0  arm
151.0  load 6 3
expect 175 charge
end 176
