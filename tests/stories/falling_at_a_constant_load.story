# The voltage falls at a constant load: not sag, so the resting voltage falls as well.
# ArduPilot 4.8-dev attributes the fall to resistance and never trips.
param BATT_LOW_VOLT 10.5
param BATT_FS_VOLTSRC 1
 0.0  voltage 11.1 current 5 arm
 5.0  voltage 10.4
expect 15.1 low
expect 15.1 says Battery 1 is low 10.4
end 20
