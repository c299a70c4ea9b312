# Gappa: force, torque and the lever's torque of firmware/core/solve/wrench.c, from the exact result to what is published.
# test_rounding.py fills in what stands between at-signs from the C. Signs are put back last, so magnitudes are enough,
# except in the lever.
#
# s      a sum of signals, exact for the force; g its gain in nN
# y z    the point of contact in lever units, fy fz a force; its high parts are cut off at @split@
@nearest = fixed<0, na>;
@cut = fixed<0, zr>;

force_m = nearest(force_g * @force_unit@ / @force_divisor@);
force = nearest(force_s * force_m / @force_unit@);
torque_m = nearest(torque_g * @torque_unit@ / @torque_divisor@);
torque = nearest(torque_s * torque_m / @torque_unit@);

# lever_low is y * fz_low - z * fy_low, lever_high * split the rest of y fz - z fy
lever_sum = lever_high + cut(lever_low / @split@);
lever = nearest(lever_sum / @lever_rest@);

{ force_s in [0, @force_sum_max@] /\ force_g in [0, @gain_max@]
  /\ torque_s in [0, @torque_sum_max@] /\ torque_g in [0, @gain_max@]
  /\ lever_low in [-2147483647, 2147483647] /\ lever_high in [-2147483647, 2147483647]
->
  force - force_s * force_g / @force_divisor@ in ?
  /\ torque - torque_s * torque_g / @torque_divisor@ in ?
  /\ lever - (lever_high + lever_low / @split@) / @lever_rest@ in ?
}

force - force_s * force_g / @force_divisor@ ->
    (force - force_s * force_m / @force_unit@)
    + force_s / @force_unit@ * (force_m - force_g * @force_unit@ / @force_divisor@);
torque - torque_s * torque_g / @torque_divisor@ ->
    (torque - torque_s * torque_m / @torque_unit@)
    + torque_s / @torque_unit@ * (torque_m - torque_g * @torque_unit@ / @torque_divisor@);
lever - (lever_high + lever_low / @split@) / @lever_rest@ ->
    (lever - lever_sum / @lever_rest@)
    + (cut(lever_low / @split@) - lever_low / @split@) / @lever_rest@;
