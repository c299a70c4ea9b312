// What is counted on the emulated boards: each kernel variant over the same frames, once per scene, and
// whole frames beside them. BENCH_FRAMES per weighting, given by the build.
#include "keep/settings.h"
#include "mark.h"
#include "scenes.h"
#include "variants.h"

static const struct {
    const char *name;
    unsigned wanted;
    int32_t scale;
} asked[] = {
    {"everything", VARIANT_ALL, 1},
    {"everything, doubled", VARIANT_ALL, 2}, // the ADC's whole range: where a kernel may need longer
    {"PoC only", VARIANT_POC, 1},
    {"force only", VARIANT_FORCE, 1},
    {"torque only", VARIANT_TORQUE, 1},
};

// What keeps the compiler from dropping a result.
static variant_output output;
static volatile bool has_poc;

__attribute__((noipa)) static bool nothing(const int32_t e_q4[BT_ELECTRODES],
                                           const variant_settings *settings, unsigned wanted,
                                           variant_output *out)
{
    (void)e_q4;
    (void)settings;
    (void)out;
    return wanted != 0;
}

static void next_frame(uint32_t *seed, int32_t e_q4[BT_ELECTRODES])
{
    for (int i = 0; i < BT_ELECTRODES; i++) {
        *seed = *seed * 1664525u + 1013904223u;
        // A quarter bulges a little, the rest is compressed by up to 2000 counts.
        int32_t size = (int32_t)(*seed >> 17);
        e_q4[i] = *seed & 0xC000 ? -size : size / 8;
    }
}

static void count(const char *name, const char *scene, variant_run *run, unsigned wanted,
                  const variant_settings *settings, const int32_t e_q4[BT_ELECTRODES])
{
    bench_name(name, scene);
    bench_mark();
    has_poc = run(e_q4, settings, wanted, &output);
    bench_mark();
}

static void one_frame(const int32_t e_q4[BT_ELECTRODES], const variant_settings *settings)
{
    count("nothing", "", nothing, VARIANT_ALL, settings, e_q4);
    for (int v = 0; v < VARIANTS; v++) {
        int scenes = variants[v].in_parts ? (int)(sizeof asked / sizeof *asked) : 1;
        for (int s = 0; s < scenes; s++) {
            int32_t scaled_q4[BT_ELECTRODES];
            for (int i = 0; i < BT_ELECTRODES; i++) {
                scaled_q4[i] = asked[s].scale * e_q4[i];
            }
            count(variants[v].name, asked[s].name, variants[v].run, asked[s].wanted, settings, scaled_q4);
        }
    }
    bt_solve_settings by_default = settings->shipped;
    by_default.population = true; // as on a board that nobody calibrated
    for (const bench_scene *scene = bench_scenes; scene->kernel != NULL; scene++) {
        bench_name(scene->kernel, scene->name);
        bench_mark();
        scene->run(&by_default);
        bench_mark();
    }
}

int main(void)
{
    bt_settings defaults;
    bt_settings_reset(&defaults);
    int32_t force_nn[3] = {bt_settings_get(&defaults, BT_SETTING_FORCE_GAIN_X_NN),
                           bt_settings_get(&defaults, BT_SETTING_FORCE_GAIN_Y_NN),
                           bt_settings_get(&defaults, BT_SETTING_FORCE_GAIN_Z_NN)};
    int32_t torque_nn[2] = {bt_settings_get(&defaults, BT_SETTING_TORQUE_GAIN_Y_NN),
                            bt_settings_get(&defaults, BT_SETTING_TORQUE_GAIN_Z_NN)};
    bench_scenes_init();
    for (int weights = 0; weights <= 2; weights++) {
        variant_settings settings;
        variant_settings_init(&settings, weights, force_nn, torque_nn);
        uint32_t seed = 1;
        for (int k = 0; k < BENCH_FRAMES; k++) {
            int32_t e_q4[BT_ELECTRODES];
            next_frame(&seed, e_q4);
            one_frame(e_q4, &settings);
        }
    }
    bench_end();
    return 0;
}
