# The same load with the resting voltage: the resistance is known after the first step, and nothing trips.
param BATT_LOW_VOLT 10.5
param BATT_FS_VOLTSRC 1
 0.0  voltage 10.98 current 2 arm
10.0  voltage 10.38 current 12
12.0  voltage 10.92 current 3
15.0  voltage 10.38 current 12
27.0  voltage 10.92 current 3
30.0  voltage 10.38 current 12
42.0  voltage 10.92 current 3
45.0  voltage 10.38 current 12
57.0  voltage 10.92 current 3
end 60
