# By its voltage alone another pack is found without an announcement.
param BATT_MONITOR 3
param BATT_CELLS 2
  0.0  pack 300 50 85
expect 40 charge
 45.0  unplug
 60.0  pack 300 50 62
expect 125 charge
end 126
