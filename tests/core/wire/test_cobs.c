// COBS and CRC at every address, as no host sees them. Against protocol/vectors/, which other libraries made:
// tests/protocol/test_conformance.py, and test_deframer_fuzz.py for noise.
#include "../support.h"

#include "wire/cobs.h"
#include "wire/crc32.h"

TEST(what_is_not_cobs_has_no_length)
{
    uint8_t out[4];
    assert_int_equal(bt_cobs_decode((const uint8_t *)"\0", 1, out), -1);
    assert_int_equal(bt_cobs_decode((const uint8_t *)"\2\0", 2, out), -1);
    assert_int_equal(bt_cobs_decode((const uint8_t *)"\2\7", 1, out), -1); // bytes behind it are not read
    assert_int_equal(bt_cobs_decode((const uint8_t *)"\1\3\7", 3, out), -1);
    assert_int_equal(bt_cobs_decode((const uint8_t *)"\2\7\1", 3, out), 2);
}

// Both work in words: at any start and end, they write nothing outside.
TEST(any_block_comes_back_from_any_address)
{
    uint64_t seed = 21;
    for (int run = 0; run < 20000; run++) {
        uint8_t room[BT_COBS_BLOCK_BYTES + 16], plain[BT_COBS_BLOCK_BYTES], back[BT_COBS_BLOCK_BYTES + 1];
        size_t bytes = (size_t)random_range(&seed, 0, run % 4 ? 24 : BT_COBS_BLOCK_BYTES);
        uint8_t *block = room + 4 + random_range(&seed, 0, 3);
        int64_t top = run % 3 ? 255 : 1; // has_zero takes a 1 above a 0 for a zero
        memset(room, 0xA5, sizeof room);
        for (size_t k = 0; k < bytes; k++) {
            block[1 + k] = plain[k] = (uint8_t)random_range(&seed, 0, top);
        }
        uint32_t crc = 0xFFFFFFFFu;
        for (size_t k = 0; k < 8 * bytes; k++) {
            crc = crc >> 1 ^ (0xEDB88320u & (0u - ((crc ^ (uint32_t)plain[k / 8] >> k % 8) & 1)));
        }
        assert_int_equal(bt_crc32(block + 1, bytes), ~crc);
        bt_cobs_in_place(block, bytes + 1);
        assert_true(memchr(block, 0, bytes + 1) == NULL);
        assert_int_equal(bt_cobs_decode(block, bytes + 1, back), bytes);
        assert_memory_equal(back, plain, bytes);
        assert_int_equal(block[-1], 0xA5);
        assert_int_equal(block[bytes + 1], 0xA5);
    }
}
