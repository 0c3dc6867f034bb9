# 60 mΩ: 12 A sag the pack below the threshold for 12 s. The terminal voltage trips.
param BATT_LOW_VOLT 10.5
param BATT_FS_LOW_ACT 2
 0.0  voltage 10.98 current 2 arm
10.0  voltage 10.38 current 12
12.0  voltage 10.92 current 3
15.0  voltage 10.38 current 12
expect 25.1 low
expect 25.1 says Battery 1 is low
expect 25.2 brake
27.0  voltage 10.92 current 3
end 30
