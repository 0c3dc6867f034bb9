# Charge thresholds without a current sensor: 3.67 V a cell are 11 %, and with the curve's uncertainty less than 30.
param BATT_MONITOR 3
param BATT_CELLS 3
param BATT_CAPACITY 1000
param BATT_LOW_MAH 300
param BATT_CRT_MAH 100
param BATT_FS_LOW_ACT 2
 0.0  voltage 11.0
 3.0  arm
expect 3.1 low
expect 3.1 says Battery 1 is low
expect 3.5 brake
end 5
