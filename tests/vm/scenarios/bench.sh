# What the scenarios share: the physics process, the button, lamps, and a sentence that must be there.
LINES_BASE=$(for chip in /sys/class/gpio/gpiochip*; do [ "$(cat "$chip/label")" = relens-sim ] && cat "$chip/base"; done)
RIG=/rigs/virtual.toml; export RELENS_RIG=$RIG

start_physics() {
  physics /rigs/truth.toml /dev/dri/card0 /dev/video0 "$LINES_BASE" > /tmp/physics.log 2>&1 &
  PHYSICS=$!
  for _ in $(seq 300); do grep -q ready /tmp/physics.log && return; sleep 0.2; done
  cat /tmp/physics.log; fail "physics did not start"
}

fail() { echo "FAIL: $*"; exit 1; }
press_button() { echo pull-up > "$LINES_DIR/sim_gpio1/pull"; sleep "${1:-0.2}"; echo pull-down > "$LINES_DIR/sim_gpio1/pull"; }
lamp() { cat "$LINES_DIR/sim_gpio$1/value"; } # 2 ready, 3 busy, 4 trouble
# says WORDS COMMAND...: the command must fail and say the words.
says() {
  words=$1; shift
  "$@" > /tmp/said 2>&1 && { cat /tmp/said; fail "$* succeeded"; }
  grep -q "$words" /tmp/said || { cat /tmp/said; fail "$* did not say \"$words\""; }
  echo "told as it should be: $(grep "$words" /tmp/said | head -n1)"
}
