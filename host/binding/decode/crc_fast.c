#include "decode/crc_fast.h"

#include "wire/crc32.h"

#include <stdbool.h>

#if defined(__GNUC__) && defined(__x86_64__)
#define CAN_MULTIPLY 1
#include <immintrin.h>
#else
#define CAN_MULTIPLY 0
#endif

// ---- by table --------------------------------------------------------------------------------------

// In any byte order, and one load where that is this machine's.
static uint32_t u32_at(const uint8_t *at)
{
    return (uint32_t)at[0] | (uint32_t)at[1] << 8 | (uint32_t)at[2] << 16 | (uint32_t)at[3] << 24;
}

static void complement_four(uint8_t *data)
{
    for (int k = 0; k < 4; k++) {
        data[k] = (uint8_t)~data[k];
    }
}

static uint32_t by_table(const bt_crc_fast *fast, uint8_t *data, size_t bytes)
{
    const uint32_t (*slices)[256] = (const uint32_t (*)[256])fast->slices;
    const uint8_t *at = data + bytes - (bytes + 7) / 8 * 8;
    const uint8_t *end = data + bytes;
    uint32_t crc = 0;
    complement_four(data);
    for (; at < end; at += 8) {
        uint32_t low = crc ^ u32_at(at);
        uint32_t high = u32_at(at + 4);
        crc = slices[7][low & 0xFF] ^ slices[6][low >> 8 & 0xFF] ^ slices[5][low >> 16 & 0xFF]
              ^ slices[4][low >> 24] ^ slices[3][high & 0xFF] ^ slices[2][high >> 8 & 0xFF]
              ^ slices[1][high >> 16 & 0xFF] ^ slices[0][high >> 24];
    }
    complement_four(data);
    return bt_crc32_end(crc);
}

// ---- by multiplication -----------------------------------------------------------------------------
// Gopal and others, "Fast CRC Computation for Generic Polynomials Using PCLMULQDQ Instruction", Intel 2009:
// powers of x modulo the polynomial, and Barrett's quotient, bits reflected.

#if CAN_MULTIPLY
#define X_TO_160        0x1751997D0 // folds the low half of 16 bytes over the next 16
#define X_TO_96         0x0CCAA009E // and the high half
#define X_TO_64         0x163CD6124
#define POLYNOMIAL      0x1DB710641
#define BARRETT         0x1F7011641
#define WITH_MULTIPLIER __attribute__((target("pclmul,sse4.1")))

// The ones that stand in for the start value; a window of it is as far into the first step as the data is.
static const uint8_t start[3 * 16] = {[16] = 0xFF, 0xFF, 0xFF, 0xFF};

WITH_MULTIPLIER static __m128i load(const uint8_t *at)
{
    return _mm_loadu_si128((const __m128i *)(const void *)at);
}

WITH_MULTIPLIER static __m128i fold(__m128i x, __m128i next)
{
    const __m128i over = _mm_set_epi64x(X_TO_96, X_TO_160);
    __m128i low = _mm_clmulepi64_si128(x, over, 0x00);
    __m128i high = _mm_clmulepi64_si128(x, over, 0x11);
    return _mm_xor_si128(_mm_xor_si128(low, high), next);
}

// 128 bits to the 32 of the CRC.
WITH_MULTIPLIER static uint32_t reduce(__m128i x)
{
    const __m128i low_32 = _mm_setr_epi32(-1, 0, -1, 0);
    const __m128i barrett = _mm_set_epi64x(BARRETT, POLYNOMIAL);
    __m128i to_96 = _mm_clmulepi64_si128(x, _mm_set_epi64x(0, X_TO_96), 0x00);
    x = _mm_xor_si128(_mm_srli_si128(x, 8), to_96);
    __m128i to_64 = _mm_clmulepi64_si128(_mm_and_si128(x, low_32), _mm_set_epi64x(0, X_TO_64), 0x00);
    x = _mm_xor_si128(_mm_srli_si128(x, 4), to_64);
    __m128i quotient = _mm_clmulepi64_si128(_mm_and_si128(x, low_32), barrett, 0x10);
    quotient = _mm_clmulepi64_si128(_mm_and_si128(quotient, low_32), barrett, 0x00);
    return (uint32_t)_mm_extract_epi32(_mm_xor_si128(x, quotient), 1);
}

// More than 16 bytes.
WITH_MULTIPLIER static uint32_t by_multiplication(const uint8_t *data, size_t bytes)
{
    size_t steps = (bytes + 15) / 16;
    size_t zeros = 16 * steps - bytes;
    const uint8_t *at = data - zeros;
    __m128i x = _mm_xor_si128(load(at), load(start + 16 - zeros));
    x = fold(x, _mm_xor_si128(load(at + 16), load(start + 32 - zeros)));
    for (size_t k = 2; k < steps; k++) {
        x = fold(x, load(at + 16 * k));
    }
    return bt_crc32_end(reduce(x));
}

static bool has_multiplier(void)
{
    return __builtin_cpu_supports("pclmul") && __builtin_cpu_supports("sse4.1");
}
#else
static uint32_t by_multiplication(const uint8_t *data, size_t bytes)
{
    return bt_crc32(data, bytes); // never asked for
}

static bool has_multiplier(void)
{
    return false;
}
#endif

// ----------------------------------------------------------------------------------------------------

void bt_crc_fast_set_up(bt_crc_fast *fast)
{
    fast->multiplies = has_multiplier();
    for (uint32_t byte = 0; byte < 256; byte++) {
        uint32_t crc = byte;
        for (int k = 0; k < BT_CRC_SLICES; k++) {
            crc = bt_crc32_step(crc, 0);
            fast->slices[k][byte] = crc;
        }
    }
}

uint32_t bt_crc_fast_of(const bt_crc_fast *fast, uint8_t *data, size_t bytes)
{
    if (bytes < BT_CRC_LEAST_BYTES) {
        return bt_crc32(data, bytes);
    }
    return fast->multiplies && bytes > 16 ? by_multiplication(data, bytes) : by_table(fast, data, bytes);
}
