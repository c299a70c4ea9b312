// Included before all else in the port's files: another core's instructions become a call.
#define __asm
#define volatile(...) asm_seen(#__VA_ARGS__)
void asm_seen(const char *text);
