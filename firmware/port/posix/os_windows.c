// Windows, through mingw's runtime. It cannot wait for a pipe and a socket at once: a thread reads stdin, and
// what it has read is looked for every 2 ms. And there is no exec: a board that was reset waits as a process
// for the end of the one in its place, and passes on what comes on stdin.
#include "os.h"

#include <winsock2.h>

#include <windows.h>

#include <errno.h>
#include <fcntl.h>
#include <io.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <timeapi.h>

#define LONGEST_MS 2

static char line[64];
static volatile LONG line_bytes;   // bytes in it, written by the thread while 0, and then by the board
static HANDLE volatile next_board; // the pipe to the process in its place

static DWORD WINAPI read_stdin(void *unused)
{
    char piece[sizeof line];
    DWORD bytes, passed_on;
    (void)unused;
    while (ReadFile(GetStdHandle(STD_INPUT_HANDLE), piece, sizeof piece, &bytes, NULL) && bytes > 0) {
        while (line_bytes != 0 && next_board == NULL) {
            Sleep(1);
        }
        if (next_board != NULL) {
            (void)WriteFile(next_board, piece, bytes, &passed_on, NULL);
        } else {
            memcpy(line, piece, bytes);
            (void)InterlockedExchange(&line_bytes, (LONG)bytes);
        }
    }
    if (next_board == NULL) {
        ExitProcess(0); // whoever started us is gone
    }
    (void)CloseHandle(next_board);
    return 0;
}

void os_begin(void)
{
    WSADATA sockets;
    (void)SetConsoleCtrlHandler(NULL, TRUE); // Ctrl-C is not for it
    (void)timeBeginPeriod(1);                // or every wait would last 16 ms
    (void)_setmode(_fileno(stdout), _O_BINARY);
    (void)WSAStartup(MAKEWORD(2, 2), &sockets);
}

int os_read_stdin(char *text, size_t bytes)
{
    static HANDLE thread;
    if (thread == NULL) { // not before, as under Wine more resets fail then
        thread = CreateThread(NULL, 0, read_stdin, NULL, 0, NULL);
    }
    const size_t waiting = (size_t)line_bytes, n = waiting < bytes ? waiting : bytes;
    memcpy(text, line, n);
    if (n > 0) {
        (void)InterlockedExchange(&line_bytes, 0);
    }
    return (int)n;
}

void os_wait(int host, int wanted, int control, int64_t us)
{
    WSAPOLLFD p[2];
    ULONG count = 0;
    const int ms = us < 0 || us > LONGEST_MS * 1000 ? LONGEST_MS : (int)((us + 999) / 1000);
    if (host >= 0) {
        const int events = (wanted & OS_BYTES ? POLLIN : 0) | (wanted & OS_ROOM ? POLLOUT : 0);
        p[count++] = (WSAPOLLFD){.fd = (SOCKET)host, .events = (SHORT)events};
    }
    if (control >= 0) {
        p[count++] = (WSAPOLLFD){.fd = (SOCKET)control, .events = POLLIN};
    }
    if (count == 0 || WSAPoll(p, count, ms) < 0) {
        Sleep((DWORD)ms);
    }
}

int os_inherit(int file)
{
    HANDLE handle = (HANDLE)_get_osfhandle(file);
    (void)SetHandleInformation(handle, HANDLE_FLAG_INHERIT, HANDLE_FLAG_INHERIT);
    return (int)(intptr_t)handle;
}

int os_inherited(int number)
{
    return _open_osfhandle(number, _O_RDWR | _O_BINARY);
}

void os_restart(const char *name, const char *value, char **arguments)
{
    SECURITY_ATTRIBUTES inherited = {.nLength = sizeof inherited, .bInheritHandle = TRUE};
    STARTUPINFOW begin = {.cb = sizeof begin, .dwFlags = STARTF_USESTDHANDLES};
    PROCESS_INFORMATION process;
    HANDLE pipe = NULL;
    DWORD code = 2;
    (void)arguments; // as they were quoted
    (void)_putenv_s(name, value);
    begin.hStdOutput = GetStdHandle(STD_OUTPUT_HANDLE);
    begin.hStdError = GetStdHandle(STD_ERROR_HANDLE);
    if (CreatePipe(&begin.hStdInput, &pipe, &inherited, 0)
        && SetHandleInformation(pipe, HANDLE_FLAG_INHERIT, 0)
        && CreateProcessW(NULL, GetCommandLineW(), NULL, NULL, TRUE, 0, NULL, NULL, &begin, &process)) {
        (void)CloseHandle(begin.hStdInput); // the end of the process in its place ends this one
        next_board = pipe;
        (void)WaitForSingleObject(process.hProcess, INFINITE);
        (void)GetExitCodeProcess(process.hProcess, &code);
        exit((int)code);
    }
    errno = EAGAIN;
}
