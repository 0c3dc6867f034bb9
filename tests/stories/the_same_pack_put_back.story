# A plug out and in is no other pack: it keeps the charge that was counted, and nothing is announced.
param BATT_CAPACITY 300
param BATT_CELLS 2
  0.0  pack 300 50 100
 10.0  arm
 11.0  load 6 3
 81.0  load 0 0
 83.0  disarm
 85.0  unplug
 85.5  plug
expect 95 charge
100.0  unplug
101.1  plug
102.0  unplug
103.1  plug
expect 112 charge
115.0  unplug
120.0  plug
expect 129 charge
130.0  unplug
250.0  plug
expect 260 charge
end 261
