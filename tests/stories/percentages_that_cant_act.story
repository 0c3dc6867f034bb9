# In the flat middle of LiFe cells the voltage alone leaves the charge too uncertain. That is announced once in a drive, and
# nothing is refused.
param BATT_MONITOR 3
param BATT_CHEM 2
param BATT_CELLS 3
param BATT_FS_PCT_EN 1
param BATT_FS_CRT_ACT 2
 0.0  voltage 9.88
10.0  arm
20.0  disarm
30.0  arm
expect 10.1 says Battery 1 percentages can't act: set BATT_LOW_VOLT
expect 30.1 says Battery 1 percentages can't act: set BATT_LOW_VOLT
end 40
