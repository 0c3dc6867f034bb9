# A cold pack has several times the resistance: its load ends the drive long before it is empty, and what is usable is low
# while more is left. It is not learnt.
param BATT_CAPACITY 30
param BATT_CELLS 2
  0.0  pack 30 700 100
  5.0  load 1.3 0.4
expect  71.9 says~1 Battery 1 low: 6.4*% usable
expect  80.4 says~1 Battery 1 emergency: 6.3*% usable
end 100
