# Gappa: one coordinate of to_radius (firmware/core/solve/poc.c), from the exact direction to what is published.
# test_finaliser.py fills in what stands between at-signs from the C; it says where each hypothesis comes from.
#
# te     exact direction cosine, 0..1 (signs are put back at the end, so magnitudes are enough)
# t      the same of the components once they are rounded to 16 bits
# root   relative error of the table, cut that of cutting the squares, half that of halving
# at     component * inverse; um and lever are what leaves the function
@floor = fixed<0, dn>;

inverse_error = (1 + root) * (1 + cut) * (1 + half) - 1;
at = @share@ * 4294967296 * t * (1 + inverse_error);
um_share = floor(at / 4096);
um_wide = um_share * @um_factor@ + @um_half@;
um = floor(um_wide / @um_unit@);
lever_share = floor(at / 32768);
lever_wide = lever_share * @lever_factor@ + @lever_middle@;
lever = floor(lever_wide / @lever_unit@);

{ te in [0, 1] /\ t in [0, 1]
  /\ t - te in [-@direction@, @direction@]
  /\ root in [@root_low@, @root_high@]
  /\ cut in [0, @cut@]
  /\ half in [0, @half@]
->
  um - @radius@ * te in ?
  /\ at in ? /\ um_wide in ? /\ lever_wide in ?
  /\ lever * 10000 / 131072 - @radius@ * t * (1 + inverse_error) in ?
}

# Where the error comes from, spelt out: rounding, cutting to 20 or 17 bits, length, direction.
um - @radius@ * te ->
    (um - um_wide / @um_unit@) + (um_share - at / 4096) * (@um_factor@ / @um_unit@) + @um_half@ / @um_unit@
    + @radius@ * t * inverse_error + @radius@ * (t - te);
lever * 10000 / 131072 - @radius@ * t * (1 + inverse_error) ->
    (lever - lever_wide / @lever_unit@) * (10000 / 131072)
    + (lever_share - at / 32768) * (@lever_factor@ / @lever_unit@ * (10000 / 131072))
    + @lever_middle@ / @lever_unit@ * (10000 / 131072)
    + @radius@ * t * (1 + inverse_error) * (@lever_gain@ - 1);
