# Sourced by tools/test and tools/nightly: the steps that they are made of, and what each needs installed.
# shellcheck shell=bash disable=SC2086
. tools/venv.sh
export BIOTAC_CI=1 # a proof or a rig whose tool is missing fails instead of being skipped
PATH="$PWD/.venv/bin:$PATH"
export OPENBLAS_NUM_THREADS=1 # whose threads spin while they wait for each other: tens of times the CPU on a busy computer
unset PYTHONDONTWRITEBYTECODE # with it every process that a test starts compiles NumPy and this package again

step() { # step "WHAT IS DONE" FUNCTION [ARGUMENT...]: runs it and tells what time it and all its children took
    local TIMEFORMAT='-- %0R s; CPU %1U s user, %1S s system'
    printf '\n== %s\n' "$1"
    shift
    time "$@"
}

both() { # both "WHAT" "COMMAND" "WHAT ELSE" "COMMAND": two steps at once, each of which keeps one core busy
    local output result=0
    output=$(mktemp)
    step "$3" $4 >"$output" 2>&1 &
    (step "$1" $2) # in a shell of its own, whose children are not the other's
    wait $! || result=$?
    cat "$output"
    rm "$output"
    return $result
}

install_for_quick() {
    make_venv test
    need "test -e /usr/include/cmocka.h" libcmocka-dev
}

install_for_fuzzing() {
    need "echo 'int LLVMFuzzerTestOneInput(void){return 0;}' | clang -fsanitize=fuzzer,address -xc - -o /dev/null" \
        clang libclang-rt-dev
}

install_for_proofs_boards_and_pages() {
    need "command -v gappa" gappa # proofs of bounds
    # The emulated rig: the emulator, its sensors as WebAssembly, and the board's image.
    need "command -v node" nodejs
    need "command -v npm" npm
    need "command -v clang" clang
    need "command -v wasm-ld" lld
    need "arm-none-eabi-gcc -print-file-name=nano.specs | grep / " gcc-arm-none-eabi libnewlib-arm-none-eabi
    need "command -v qemu-system-arm" qemu-system-arm
    need "command -v chromium" chromium # the page of `biotac view`
    need "command -v sigrok-cli" sigrok-cli # what the emulated Pico writes for a logic analyser
}

generated_files() {
    python tools/gen_protocol.py --check
    python tools/make/vectors.py --check
}

style() {
    ruff check .
    ruff format --check .
    mypy
    git ls-files '*.c' '*.h' | grep -v _gen | xargs clang-format --dry-run -Werror
}

c_build() { # c_build FOLDER [CMAKE-OPTION...]: the C tests, in build/FOLDER
    local build=build/$1
    shift
    cmake -S . -B "$build" -G Ninja -DBIOTAC_TESTS=ON -DPython_EXECUTABLE="$PWD/.venv/bin/python" "$@" >/dev/null
    cmake --build "$build" >"$build/log" || { cat "$build/log"; return 1; }
}

c_tests() { # arguments as c_build's
    c_build "$@"
    ctest --test-dir "build/$1" -j2 --output-on-failure
}

images() { # a link refuses what is over its board's limits.json: flash, RAM, stack, waits, floats
    local board
    for board in firmware/boards/*/CMakeLists.txt; do
        board=$(basename "$(dirname "$board")")
        cmake -S firmware -B "build/$board" -G Ninja -DBIOTAC_BOARD="$board" >/dev/null
        cmake --build "build/$board"
    done
    cmake -S firmware/sensor_board -B build/sensor-board -G Ninja >/dev/null
    cmake --build build/sensor-board
    tools/emulator/prepare
}

m4f_tests() { # arguments go to ctest
    cmake -S tests/target/m4f -B build/m4f -G Ninja >/dev/null
    cmake --build build/m4f >build/m4f/log || { cat build/m4f/log; return 1; }
    ctest --test-dir build/m4f -j2 --output-on-failure "$@"
}

sanitized() { # sanitized COMMAND: with the package as installed, but for its extension, which is of build/sanitize
    local package
    package=$(python -c 'import biotac; print(biotac.__path__[0])')
    c_build sanitize -DBIOTAC_SANITIZE=ON
    rm -rf build/sanitized
    mkdir build/sanitized
    cp -a "$package" build/sanitized/
    cp build/sanitize/host/_core*.so build/sanitized/biotac/
    LD_PRELOAD="$(gcc -print-file-name=libasan.so) $(gcc -print-file-name=libubsan.so)" ASAN_OPTIONS=detect_leaks=0 \
        PYTHONPATH="$PWD/build/sanitized" "$@"
}

test_modules() { # Python compiles them here, and what they import, or each of three processes does
    pytest --collect-only -q >build/collected || { cat build/collected; return 1; }
}

python_tests() { # arguments go to pytest; processes with whole files each, for what tests of a file share
    # Three on two cores: almost half of the time a test waits for a board whose time is real. Skipped tests say why,
    # once a reason. What hangs is named with where it stands, after longer than any test takes on a busy computer.
    pytest -rsfE -n 3 --dist loadfile --no-loadscope-reorder --timeout 900 "$@"
}
