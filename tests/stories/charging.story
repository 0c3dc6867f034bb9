# A charger on a disarmed rover; its plug is loose. A current into an armed one is that of braking.
param BATT_CELLS 3
param BATT_AMP_OFFSET 1.5
 0.0  voltage 11.5 current 26.0
 5.0  current 22.5
expect 8.1 says Battery 1 charging
12.0  current 25.5
16.0  current 22.5
20.0  current 25.5
24.0  arm
25.0  current 22.5
expect 27.0 turn
30.0  disarm
end 35
