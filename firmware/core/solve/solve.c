#include "solve/solve.h"

#include "fixed_point.h"
#include "map/lesson.h"
#include "map/population.h"
#include "solve/poc.h"
#include "touch/thermal.h"

_Static_assert(BT_ELECTRODE_MAX_UM <= INT16_MAX, "a PoC must fit the message");

#define NN_PER_MN_Q8   (1000000 / 256)
#define USUAL_COUNT_MN 10u // Navarro 2015 has 9 to 16

// False for a finger or board with given force gains: they say more about it than other fingers do.
static bool wants_population(const bt_settings *settings)
{
    static const uint8_t gains[3] = {BT_SETTING_FORCE_GAIN_X_NN, BT_SETTING_FORCE_GAIN_Y_NN,
                                     BT_SETTING_FORCE_GAIN_Z_NN};
    bt_settings defaults;
    bt_settings_reset(&defaults);
    bool wanted = bt_settings_get(settings, BT_SETTING_FORCE_MODEL) == BT_FORCE_MODEL_POPULATION;
    for (int d = 0; d < 3; d++) {
        wanted = wanted && bt_settings_get(settings, gains[d]) == bt_settings_get(&defaults, gains[d]);
    }
    return wanted;
}

// The tare follows temperature by about half a count per count of TDC; 1/BT_WRONG_SHARE of that may be wrong,
// on all electrodes alike. The maps hardly feel it.
static uint32_t warmed_max_q8(const bt_gains *gains, bool population)
{
    int32_t e_q4[BT_ELECTRODES], force_100un[3];
    for (int i = 0; i < BT_ELECTRODES; i++) {
        e_q4[i] = 16; // a count of error
    }
    bt_force(e_q4, gains, force_100un);
    uint32_t most = 1;
    for (int d = 0; d < 3; d++) {
        most = bt_abs32(force_100un[d]) > most ? bt_abs32(force_100un[d]) : most;
    }
    uint32_t limit_q8 = 2 * BT_WRONG_SHARE * 256 * BT_WARMED_100UN / most;
    return population || limit_q8 > BT_DEGREE_Q8 ? BT_DEGREE_Q8 : limit_q8;
}

bt_solve_settings bt_solve_settings_from(const bt_settings *settings)
{
    int32_t force_nn[3] = {bt_settings_get(settings, BT_SETTING_FORCE_GAIN_X_NN),
                           bt_settings_get(settings, BT_SETTING_FORCE_GAIN_Y_NN),
                           bt_settings_get(settings, BT_SETTING_FORCE_GAIN_Z_NN)};
    int32_t torque_nn[2] = {bt_settings_get(settings, BT_SETTING_TORQUE_GAIN_Y_NN),
                            bt_settings_get(settings, BT_SETTING_TORQUE_GAIN_Z_NN)};
    bt_solve_settings kernel = {
        .poc_weights = (int)bt_settings_get(settings, BT_SETTING_POC_WEIGHTS),
        .gains = bt_gains_from(force_nn, torque_nn),
        .population = wants_population(settings),
        .count_mn_q8 = (uint32_t)bt_settings_get(settings, BT_SETTING_PRESSURE_GAIN_NN) / NN_PER_MN_Q8,
    };
    kernel.count_mn_q8 = kernel.count_mn_q8 > 0 ? kernel.count_mn_q8 : USUAL_COUNT_MN << 8;
    kernel.warmed_max_q8 = warmed_max_q8(&kernel.gains, kernel.population);
    return kernel;
}

// Element by element: for a copy the board would call memcpy in every frame.
static void mark_poc(int16_t poc_um[3])
{
    poc_um[0] = BT_INVALID_I16;
    poc_um[1] = BT_INVALID_I16;
    poc_um[2] = BT_INVALID_I16;
}

static void mark(int32_t result[3])
{
    result[0] = BT_INVALID_I32;
    result[1] = BT_INVALID_I32;
    result[2] = BT_INVALID_I32;
}

static inline void give_poc(bool valid, const bt_point *point, int16_t poc_um[3])
{
    if (valid) {
        poc_um[0] = point->um[0];
        poc_um[1] = point->um[1];
        poc_um[2] = point->um[2];
    } else {
        mark_poc(poc_um);
    }
}

static uint32_t population_force(const bt_map *map, const int32_t e_q4[BT_ELECTRODES], int32_t force_100un[3],
                                 bt_uncertainty *uncertainty)
{
    bt_likeness likeness = bt_population_force(map, e_q4, force_100un);
    bt_population_guess(likeness.share, likeness.outside, likeness.strength_100un, uncertainty->guess_mn);
    uncertainty->off_100un = likeness.off_100un;
    return likeness.outside ? BT_FRAME_FLAG_OUTSIDE : 0;
}

// A map's force, as far as the touch resembles the map's lesson.
static uint32_t by_lesson(const bt_map *map, const bt_map_parts *parts, const int32_t e_q4[BT_ELECTRODES],
                          int32_t force_100un[3], bt_uncertainty *uncertainty)
{
    if (map->lesson == NULL) {
        return BT_FRAME_FLAG_OUTSIDE;
    }
    if (force_100un[0] == BT_INVALID_I32) {
        return 0;
    }
    uncertainty->shear_max_mn = bt_lesson_shear_max_mn(map);
    const bt_lesson_verdict verdict = bt_lesson_judge(map, force_100un, parts);
    if (verdict.apart > 0) {
        bt_lesson_margin(map, verdict.apart, &uncertainty->of_touch);
        uncertainty->margin = &uncertainty->of_touch;
    }
    if (verdict.share == BT_LESSON_ALL) {
        return 0;
    }
    int32_t otherwise_100un[3];
    uint32_t *guess_mn = uncertainty->guess_mn;
    uint32_t flags = population_force(&bt_population, e_q4, otherwise_100un, uncertainty);
    bt_lesson_mix(map, verdict.share, otherwise_100un, force_100un);
    guess_mn[0] = bt_lesson_guess_mn(map, verdict.share, guess_mn[0]);
    guess_mn[1] = bt_lesson_guess_mn(map, verdict.share, guess_mn[1]);
    return flags | BT_FRAME_FLAG_POPULATION;
}

uint32_t bt_solve(const int32_t e_q4[BT_ELECTRODES], const bt_solve_settings *settings, uint32_t wanted,
                  int16_t poc_um[3], int32_t force_100un[3], int32_t torque_mnmm[3],
                  bt_uncertainty *uncertainty)
{
    bt_point point;
    uint32_t flags = 0;
    bool asked = wanted & (BT_WANT_POC | BT_WANT_TORQUE);
    bool located = asked && bt_poc(e_q4, settings->poc_weights, &point);
    give_poc(located && wanted & BT_WANT_POC, &point, poc_um);
    if (wanted & (BT_WANT_FORCE | BT_WANT_TORQUE)) {
        if (uncertainty != NULL) {
            flags =
                BT_FRAME_FLAG_POPULATION | population_force(&bt_population, e_q4, force_100un, uncertainty);
        } else if (wanted & BT_WANT_FORCE) {
            bt_force(e_q4, &settings->gains, force_100un);
        } else {
            bt_force_yz(e_q4, &settings->gains, force_100un);
        }
    }
    if (wanted & BT_WANT_TORQUE) {
        bt_torque_yz(e_q4, &settings->gains, torque_mnmm + 1);
        torque_mnmm[0] = located ? bt_torque_x_derived(point.lever_yz, force_100un) : BT_INVALID_I32;
    } else {
        mark(torque_mnmm);
    }
    if (!(wanted & BT_WANT_FORCE)) {
        mark(force_100un);
    }
    return flags | (asked && !located ? BT_FRAME_FLAG_POC_INVALID : 0);
}

uint32_t bt_solve_mapped(const int32_t e_q4[BT_ELECTRODES], const bt_map_input *frame,
                         const bt_solve_settings *settings, uint32_t wanted, int16_t poc_um[3],
                         int32_t force_100un[3], int32_t torque_mnmm[3], int32_t *torsion_mnmm,
                         bt_uncertainty *uncertainty)
{
    bt_point point;
    bt_map_parts parts;
    uint32_t flags = 0;
    bool derived = wanted & BT_WANT_TORQUE && settings->map->axes == BT_MAP_AXES_FORCE;
    bool asked = wanted & BT_WANT_POC || derived;
    bool located = asked && bt_poc(e_q4, settings->poc_weights, &point);
    give_poc(located && wanted & BT_WANT_POC, &point, poc_um);
    *torsion_mnmm = BT_INVALID_I32;
    if (wanted & (BT_WANT_FORCE | BT_WANT_TORQUE)) {
        if (bt_population_like(settings->map)) {
            flags = population_force(settings->map, e_q4, force_100un, uncertainty);
        } else {
            bt_map_wrench_of(settings->map, e_q4, frame->counts, frame->tare_q4, frame->pdc_above_rest_q4,
                             force_100un, wanted & BT_WANT_TORQUE ? torque_mnmm : NULL, torsion_mnmm,
                             settings->map->lesson != NULL ? &parts : NULL);
            flags = by_lesson(settings->map, &parts, e_q4, force_100un, uncertainty);
        }
    }
    if (derived) {
        bool possible = located && force_100un[0] != BT_INVALID_I32;
        bt_torque_yz(e_q4, &settings->gains, torque_mnmm + 1);
        torque_mnmm[0] = possible ? bt_torque_x_derived(point.lever_yz, force_100un) : BT_INVALID_I32;
    } else if (!(wanted & BT_WANT_TORQUE)) {
        mark(torque_mnmm);
    }
    if (!(wanted & BT_WANT_FORCE)) {
        mark(force_100un);
    }
    return flags | (asked && !located ? BT_FRAME_FLAG_POC_INVALID : 0);
}
