# A sensor that fails for more than 5 s; 3 s have no effect.
param BATT_LOW_VOLT 10.5
 0.0  voltage 11.5 current 5 arm
10.0  fail
expect 15.1 unhealthy
expect 15.1 says Battery 1 is missing, last: 11.
18.0  work
25.0  fail
28.0  work
end 35
