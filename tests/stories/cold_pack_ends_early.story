# A cold pack has several times the resistance: its load ends the drive long before it is empty, and what is usable is low
# while more is left. It is not learnt.
param BATT_CAPACITY 30
param BATT_CELLS 2
  0.0  pack 30 700 100
  5.0  load 1.3 0.4
expect  60.4 says~1 Battery 1 low: 7.1*% usable
expect  67.4 says~1 Battery 1 emergency: 7.1*% usable
end 100
