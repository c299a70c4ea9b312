// Layout of a map's lesson (lesson.h) in the blob, and the limits that bt_map_open checks.
#ifndef BIOTAC_LESSON_LIMITS_H
#define BIOTAC_LESSON_LIMITS_H

#define BT_LESSON_BYTES   136
#define BT_LESSON_VERSION 2 // of the factors; in the blob's header, 0: no lesson
#define BT_LESSON_FACTORS 10
#define BT_LESSON_ROWS    6

// In the blob: u16 scale, u16 largest size; u16 base, share of normal, of shear; u8 exponent, u8 largest
// shear, u8 least share of z, u8 pressure; then weights, three rows side by side as the axes of a map.
#define BT_LESSON_SCALE_AT    0
#define BT_LESSON_SIZE_AT     2
#define BT_LESSON_MARGIN_AT   4
#define BT_LESSON_EXPONENT_AT 12
#define BT_LESSON_SHEAR_AT    13 // in 64 mN; 0: unknown
#define BT_LESSON_Z_AT        14 // in 1/256 of the size; 0: unknown
#define BT_LESSON_PRESSURE_AT 15 // in counts per newton of normal; 0: unknown
#define BT_LESSON_WEIGHT_AT   16

#define BT_LESSON_SCALE_MAX_Q8 1024
#define BT_LESSON_EXPONENT_MAX 20
#define BT_LESSON_FACTOR_MAX   32767

#endif
