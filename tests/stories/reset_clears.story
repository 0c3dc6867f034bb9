# A battery reset clears the failsafe; a voltage that is still low trips again after the timer.
param BATT_LOW_VOLT 10.5
param BATT_LOW_TIMER 5
 0.0  voltage 11.1 current 5 arm
 2.0  voltage 10.4
expect 7.1 low
expect 7.1 says Battery 1 is low
20.0  reset 100
expect 25.1 low
expect 25.1 says Battery 1 is low
end 30
