# Functions of the scenarios: light, button, lamps, and required messages.
LINES_BASE=$(for chip in /sys/class/gpio/gpiochip*; do [ "$(cat "$chip/label")" = relens-sim ] && cat "$chip/base"; done)
RIG=/rigs/virtual.toml; export RELENS_RIG=$RIG

PORT=/dev/$(for port in /sys/class/virtio-ports/*; do [ "$(cat "$port/name")" = light ] && basename "$port"; done)

# While this file exists, triggers give no frames. The window is not killed instead, since a pending answer of the physics
# process would shift every later frame by one.
SHUTTER=/tmp/shutter-closed

# While this file exists, a scene is before the lens instead of the panel.
AWAY=/tmp/panel-away

# While this file exists, the USB camera is plugged in.
PLUG=/tmp/usb-camera

open_window() {
  # The window of an earlier scenario is used again.
  WINDOW=$(cat /tmp/window.pid 2>/dev/null) && kill -0 "$WINDOW" 2>/dev/null && return
  window "${TRUTH:-/rigs/truth.toml}" /dev/dri/card0 /dev/video0 "$LINES_BASE" "$PORT" $SHUTTER $AWAY $PLUG ${FREE_RUN:-} > /tmp/window.log 2>&1 &
  WINDOW=$!; echo $WINDOW > /tmp/window.pid
  for _ in $(seq 300); do grep -q "window is open" /tmp/window.log && return; sleep 0.2; done
  cat /tmp/window.log; fail "no light"
}

fail() { echo "FAIL: $*"; exit 1; }
press_button() { echo pull-up > "$LINES_DIR/sim_gpio1/pull"; sleep "${1:-0.2}"; echo pull-down > "$LINES_DIR/sim_gpio1/pull"; }
lamp() { cat "$LINES_DIR/sim_gpio$1/value"; } # 2 ready, 3 busy, 4 trouble
# Waits with a limit: appears FILE SECONDS, lit LAMP SECONDS, logged WORDS SECONDS (in daemon.log)
within() { # SECONDS WHAT-FAILED COMMAND...
  patience=$(($1 * 5)); what=$2; shift 2
  for _ in $(seq $patience); do "$@" && return; sleep 0.2; done
  tail -n 40 /tmp/daemon.log; tail -n 5 /tmp/window.log; fail "$what"
}
appears() { within "$2" "$1 did not come" test -s "$1"; echo "$(date +%T) $1 is there"; }
is_lit() { [ "$(lamp "$1")" = 1 ]; }
lit() { within "$2" "lamp $1 stays dark" is_lit "$1"; }
# Makes a box with a calibration, unless an earlier scenario made it.
calibrated() {
  BOX=/tmp/box; mkdir -p $BOX/inbox
  [ -d $BOX/calibration ] || relens calibrate --rig $RIG --folder $BOX 2>&1 || fail "calibrate"
  echo "$(date +%T) calibrated"
}
exposures() { grep -c ' exposure of ' /tmp/window.log; }
more_than() { [ "$(exposures)" -gt "$1" ]; }
exposed() { within "$2" "no $1 more exposures" more_than $(($(exposures) + $1)); } # COUNT SECONDS
logged() { within "$2" "the daemon did not say \"$1\"" grep -q "$1" /tmp/daemon.log; grep "$1" /tmp/daemon.log | head -n 1; }
# says WORDS COMMAND...: the command must fail with the words in its message.
says() {
  words=$1; shift
  "$@" > /tmp/said 2>&1 && { cat /tmp/said; fail "$* succeeded"; }
  grep -q "$words" /tmp/said || { cat /tmp/said; fail "$* did not say \"$words\""; }
  echo "message as expected: $(grep "$words" /tmp/said | head -n1)"
}
# Checks the window's record: no exposure began before its picture was shown. The settle time of the rig file is 40 ms
# from the vblank; the record has the driver's time, up to a refresh later.
settled() {
  awk '/ flip to / { flip = $1 } / exposure of / { n++; wait = $1 - flip; if (n == 1 || wait < least) least = wait }
    END { printf "%d exposures, the earliest %.1f ms after its flip\n", n, least * 1e3; exit least < 0.023 }' /tmp/window.log
}
