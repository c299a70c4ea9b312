// The firmware's wire for protocol/conformance: a request a line in, an answer a line out.
#include "wire/cobs.h"
#include "wire/crc32.h"
#include "wire/framing.h"
#include "wire/messages_gen.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define LINE_BYTES (1 << 16)

// The type names in the BT_*_FIELDS lists.
typedef uint8_t u8;
typedef uint16_t u16;
typedef uint32_t u32;
typedef int16_t i16;
typedef int32_t i32;

static size_t from_hex(const char *text, uint8_t *out)
{
    size_t bytes = text[0] == '-' ? 0 : strlen(text) / 2;
    for (size_t k = 0; k < bytes; k++) {
        char two[3] = {text[2 * k], text[2 * k + 1], 0};
        out[k] = (uint8_t)strtoul(two, NULL, 16);
    }
    return bytes;
}

static void put_hex(const uint8_t *data, size_t bytes)
{
    for (size_t k = 0; k < bytes; k++) {
        printf("%02x", data[k]);
    }
    if (bytes == 0) {
        putchar('-');
    }
}

static void unframe(const uint8_t *wire, size_t bytes)
{
    unsigned outcomes[6] = {0};
    bt_deframer deframer;
    bt_deframer_reset(&deframer);
    for (size_t k = 0; k < bytes; k++) {
        enum bt_deframed outcome = bt_deframer_push(&deframer, wire[k]);
        outcomes[outcome]++;
        if (outcome == BT_DEFRAMED_GOOD) {
            printf("frame %02x ", deframer.id);
            put_hex(deframer.buffer + 1, deframer.payload_bytes);
            printf("; ");
        }
    }
    printf("counts %u %u %u %u", outcomes[BT_DEFRAMED_TOO_LONG], outcomes[BT_DEFRAMED_BAD_COBS],
           outcomes[BT_DEFRAMED_BAD_CRC], outcomes[BT_DEFRAMED_BAD_LENGTH]);
}

#define PUT_FIELD(name, type, count)                                                                         \
    printf("%s%s", separator, #name);                                                                        \
    separator = "; ";                                                                                        \
    for (int k = 0; k < (count); k++) {                                                                      \
        printf(" %lld", (long long)((const type *)(const void *)&msg.name)[k]);                              \
    }
#define TAKE_FIELD(name, type, count)                                                                        \
    strtok(NULL, " ;");                                                                                      \
    for (int k = 0; k < (count); k++) {                                                                      \
        ((type *)(void *)&msg.name)[k] = (type)strtoll(strtok(NULL, " ;"), NULL, 10);                        \
    }
#define ONE_MESSAGE(MESSAGE, struct_name)                                                                    \
    if (id == BT_##MESSAGE##_ID) {                                                                           \
        struct_name msg;                                                                                     \
        uint8_t payload[BT_##MESSAGE##_BYTES];                                                               \
        if (unpack) {                                                                                        \
            from_hex(strtok(NULL, " "), payload);                                                            \
            struct_name##_unpack(&msg, payload);                                                             \
            BT_##MESSAGE##_FIELDS(PUT_FIELD)                                                                 \
        } else {                                                                                             \
            BT_##MESSAGE##_FIELDS(TAKE_FIELD) struct_name##_pack(&msg, payload);                             \
            put_hex(payload, sizeof payload);                                                                \
        }                                                                                                    \
    }

static void message(int unpack)
{
    const char *separator = "";
    unsigned long id = strtoul(strtok(NULL, " "), NULL, 16);
    BT_WIRE_MESSAGES(ONE_MESSAGE)
}

int main(void)
{
    static char line[LINE_BYTES];
    static uint8_t data[LINE_BYTES], out[LINE_BYTES];
    while (fgets(line, sizeof line, stdin)) {
        line[strcspn(line, "\n")] = 0;
        const char *word = strtok(line, " ");
        if (strcmp(word, "crc") == 0) {
            size_t bytes = from_hex(strtok(NULL, " "), data);
            printf("%08lx", (unsigned long)bt_crc32(data, bytes));
        } else if (strcmp(word, "uncobs") == 0) {
            int bytes = bt_cobs_decode(data, from_hex(strtok(NULL, " "), data), out);
            if (bytes < 0) {
                printf("bad");
            } else {
                put_hex(out, (size_t)bytes);
            }
        } else if (strcmp(word, "frame") == 0) {
            uint8_t id = (uint8_t)strtoul(strtok(NULL, " "), NULL, 16);
            size_t bytes = from_hex(strtok(NULL, " "), data);
            put_hex(out, bt_frame_encode(id, data, bytes, out));
        } else if (strcmp(word, "unframe") == 0) {
            strtok(NULL, " "); // it takes one byte at a time, whatever the chunks
            unframe(data, from_hex(strtok(NULL, " "), data));
        } else if (strcmp(word, "unpack") == 0 || strcmp(word, "pack") == 0) {
            message(word[0] == 'u');
        } else {
            printf("no");
        }
        putchar('\n');
    }
    return 0;
}
