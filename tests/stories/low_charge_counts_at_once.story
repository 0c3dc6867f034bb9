# 36 A draw 10 mAh per second from 500 mAh. Charge thresholds have no timer.
param BATT_CAPACITY 500
param BATT_LOW_MAH 200
param BATT_CRT_MAH 100
param BATT_FS_LOW_ACT 0
param BATT_FS_CRT_ACT 2
 0.0  voltage 11.5 current 36 arm
expect 30.1 low
expect 30.1 says Battery 1 is low
expect 40.1 critical
expect 40.1 says Battery 1 is critical
expect 40.2 brake
end 42
