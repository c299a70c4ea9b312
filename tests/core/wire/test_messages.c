// Every message in protocol/vectors/messages.txt: unpack gives the fields, pack gives the payload.
#include "support.h"

#include "wire/messages_gen.h"

// The type names in the BT_*_FIELDS lists.
typedef uint8_t u8;
typedef uint16_t u16;
typedef uint32_t u32;
typedef int16_t i16;
typedef int32_t i32;

#define MAX_VALUES 256

// read_HELLO and so on: values of one field by name; returns how many, -1 for no such field.
#define READ_FIELD(name, type, count)                                                                        \
    if (strcmp(field, #name) == 0) {                                                                         \
        const type *at = (const type *)(const void *)&msg->name;                                             \
        for (int k = 0; k < (count); k++) {                                                                  \
            values[k] = at[k];                                                                               \
        }                                                                                                    \
        return (count);                                                                                      \
    }
#define COUNT_BYTES(name, type, count) +(int)sizeof(type) * (count)
#define COUNT_ONE(name, type, count)   +1
#define DEFINE_ACCESS(MESSAGE, struct_name)                                                                  \
    static int read_##MESSAGE(const void *any, const char *field, int64_t *values)                           \
    {                                                                                                        \
        const struct_name *msg = any;                                                                        \
        BT_##MESSAGE##_FIELDS(READ_FIELD) return -1;                                                         \
    }                                                                                                        \
    static void unpack_##MESSAGE(void *msg, const uint8_t *in)                                               \
    {                                                                                                        \
        struct_name##_unpack(msg, in);                                                                       \
    }                                                                                                        \
    static void pack_##MESSAGE(const void *msg, uint8_t *out)                                                \
    {                                                                                                        \
        struct_name##_pack(msg, out);                                                                        \
    }
BT_WIRE_MESSAGES(DEFINE_ACCESS)

typedef struct {
    const char *name;
    uint8_t id;
    int bytes;
    int field_bytes;
    int fields;
    int (*read)(const void *msg, const char *field, int64_t *values);
    void (*unpack)(void *msg, const uint8_t *in);
    void (*pack)(const void *msg, uint8_t *out);
} message_access;

#define ACCESS_ENTRY(MESSAGE, struct_name)                                                                   \
    {#MESSAGE,                                                                                               \
     BT_##MESSAGE##_ID,                                                                                      \
     BT_##MESSAGE##_BYTES,                                                                                   \
     0 BT_##MESSAGE##_FIELDS(COUNT_BYTES),                                                                   \
     0 BT_##MESSAGE##_FIELDS(COUNT_ONE),                                                                     \
     read_##MESSAGE,                                                                                         \
     unpack_##MESSAGE,                                                                                       \
     pack_##MESSAGE},
static const message_access messages[] = {BT_WIRE_MESSAGES(ACCESS_ENTRY)};
#define MESSAGES (sizeof messages / sizeof *messages)

static const message_access *find(const char *name)
{
    for (size_t k = 0; k < MESSAGES; k++) {
        if (strcmp(messages[k].name, name) == 0) {
            return &messages[k];
        }
    }
    fail_msg("messages.txt has %s, the firmware has not", name);
    return NULL;
}

typedef struct {
    char name[LINE_BYTES];
    int64_t value[MAX_VALUES];
    int count;
} field_line;

static field_line parse_field(char *line)
{
    field_line field = {.count = 0};
    char *word = strtok(line, " ");
    (void)snprintf(field.name, sizeof field.name, "%s", word);
    while ((word = strtok(NULL, " ")) != NULL) {
        assert_true(field.count < MAX_VALUES);
        field.value[field.count++] = strtoll(word, NULL, 10);
    }
    return field;
}

static void check(const message_access *message, const char *name, const field_line *fields, int count,
                  const uint8_t *payload)
{
    union {
        max_align_t align;
        uint8_t bytes[512];
    } msg;
    uint8_t packed[BT_FRAME_MAX_BYTES + 1];
    memset(&msg, 0xA5, sizeof msg); // a field that unpack forgets differs
    message->unpack(&msg, payload);
    for (int f = 0; f < count; f++) {
        int64_t values[MAX_VALUES];
        if (message->read(&msg, fields[f].name, values) != fields[f].count) {
            fail_msg("%s: field %s has another length", message->name, fields[f].name);
        }
        if (memcmp(values, fields[f].value, sizeof *values * (size_t)fields[f].count) != 0) {
            fail_msg("%s %s: field %s differs", message->name, name, fields[f].name);
        }
    }
    memset(packed, 0x5A, sizeof packed);
    message->pack(&msg, packed);
    if (memcmp(packed, payload, (size_t)message->bytes) != 0) {
        fail_msg("%s %s: pack does not give the payload back", message->name, name);
    }
    assert_int_equal(packed[message->bytes], 0x5A); // not one byte more
}

static void unpack_gives_the_fields_and_pack_the_payload(void **state)
{
    (void)state;
    static field_line fields[MAX_VALUES];
    int seen[256] = {0};
    char line[LINE_BYTES], name[64] = "", message_name[64], hex[LINE_BYTES];
    const message_access *message = NULL;
    int count = 0;
    unsigned id;
    FILE *file = open_vectors("messages.txt");
    while (next_line(file, line)) {
        if (after_word(line, "message") != NULL) {
            assert_int_equal(sscanf(line, "message %63s %2x %63s", message_name, &id, name), 3);
            message = find(message_name);
            assert_int_equal(message->id, id);
            count = 0;
        } else if (after_word(line, "payload") != NULL) {
            uint8_t payload[BT_FRAME_MAX_BYTES];
            assert_non_null(message);
            assert_int_equal(sscanf(line, "payload %4095s", hex), 1);
            assert_int_equal(bytes_from_hex(hex, payload, sizeof payload), message->bytes);
            assert_int_equal(count, message->fields);
            check(message, name, fields, count, payload);
            seen[message->id]++;
        } else {
            assert_true(count < MAX_VALUES);
            fields[count++] = parse_field(line);
        }
    }
    for (size_t k = 0; k < MESSAGES; k++) {
        if (seen[messages[k].id] < 3) {
            fail_msg("messages.txt has no vectors for %s", messages[k].name);
        }
    }
}

static void lengths_by_id_are_those_of_the_fields(void **state)
{
    (void)state;
    int known = 0;
    for (size_t k = 0; k < MESSAGES; k++) {
        assert_int_equal(bt_wire_payload_bytes(messages[k].id), messages[k].bytes);
        assert_int_equal(messages[k].field_bytes, messages[k].bytes);
        assert_true(1 + messages[k].bytes + 4 <= BT_FRAME_MAX_BYTES);
    }
    for (int id = 0; id < 256; id++) {
        known += bt_wire_payload_bytes((uint8_t)id) >= 0;
    }
    assert_int_equal(known, MESSAGES);
}

static void a_frame_packed_as_halfwords_is_the_same(void **state)
{
    (void)state;
    uint8_t payload[BT_FRAME_BYTES];
    uint16_t halfwords[BT_FRAME_BYTES / 2];
    bt_msg_frame frame;
    for (int k = 0; k < BT_FRAME_BYTES; k++) {
        payload[k] = (uint8_t)(k * 37 + 11); // no two alike
    }
    bt_msg_frame_unpack(&frame, payload);
    bt_msg_frame_pack_even(&frame, halfwords);
    assert_memory_equal(halfwords, payload, sizeof halfwords);
}

static void invalid_marks_are_the_types_minimum(void **state)
{
    (void)state;
    uint8_t payload[BT_FRAME_BYTES];
    bt_msg_frame frame = {.poc_um = {BT_INVALID_I16, 0, 0}, .torque_mnmm = {BT_INVALID_I32, 0, 0}};
    bt_msg_frame back;
    frame.counts[18] = BT_INVALID_COUNT;
    bt_msg_frame_pack(&frame, payload);
    bt_msg_frame_unpack(&back, payload);
    assert_int_equal(back.poc_um[0], -32768);
    assert_int_equal(back.torque_mnmm[0], -2147483647 - 1);
    assert_int_equal(back.counts[18], 65535);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(unpack_gives_the_fields_and_pack_the_payload),
        cmocka_unit_test(lengths_by_id_are_those_of_the_fields),
        cmocka_unit_test(a_frame_packed_as_halfwords_is_the_same),
        cmocka_unit_test(invalid_marks_are_the_types_minimum),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
