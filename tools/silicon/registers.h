// A chip's registers as rules and not as behaviour: a port is compiled for this computer, unchanged, so that
// each volatile access calls in here (GCC's thread sanitizer instruments them, and the functions are
// ours), at the chip's own addresses, which are mapped. A model answers reads, and reports accesses that the
// chip's documents forbid.
#ifndef BIOTAC_SILICON_REGISTERS_H
#define BIOTAC_SILICON_REGISTERS_H

#include <setjmp.h>
#include <stdbool.h>
#include <stdint.h>

// The model's. on_read may change the value about to be read; on_write comes once the new value is there,
// before the next access.
void on_read(uint32_t at);
void on_write(uint32_t at, uint32_t old, uint32_t value);

void registers_map(uint32_t from, uint32_t bytes); // zeros
void registers_settle(void);                       // the latest write has come to the model
uint32_t peek(uint32_t at);                        // without the model's knowledge
void poke(uint32_t at, uint32_t value);

extern uint64_t accesses;           // of mapped memory, so far
extern uint64_t now_ns;             // 50 a volatile access, more by a model
extern char broken[2048];           // the rules that were broken, with their sources, each once and a line
extern jmp_buf registers_left;      // where a reset or a jump out of the image leads
extern uint32_t registers_reset_at; // the register that resets the chip when written
void break_rule(const char *rule);
// Whether a rule with these words was broken, or, with none, no rule; prints the rule, and clears it.
bool broke(const char *words);

// The text of an assembler statement of the port; -include asm_seen.h makes each of them this call.
void asm_seen(const char *text);
void on_asm(const char *text); // the model's

#endif
