# Sourced by scripts that need Python packages, after they have defined `python` and `fail`.

# python_environment PLACE REQUIREMENTS: a virtual environment with what the file pins. It is current when it was made from the same requirements by the same Python; the stamp is written
# last. Fails where the packages are not to be had: the network is needed the first time.
python_environment() {
    local place=$1 requirements=$2 wanted
    wanted=$("$python" --version; cat "$requirements")
    if [[ -f $place/installed && $(<"$place/installed") == "$wanted" ]]; then
        return
    fi
    printf 'making %s (some minutes the first time)\n' "$place" >&2
    rm -rf "$place"
    mkdir -p "$(dirname "$place")"
    "$python" -m venv "$place" || fail 'cannot make a virtual environment; on Debian and Ubuntu: apt-get install python3-venv'
    "$place/bin/python" -m pip install --quiet --disable-pip-version-check --requirement "$requirements" || return
    printf '%s\n' "$wanted" >"$place/installed"
}
