# Sourced by scripts that need Python packages, after they have defined `python` and `fail`.

# python_environment PLACE REQUIREMENTS: makes a virtual environment with the packages that the file pins. It is current if the same Python made it from the same requirements;
# the stamp is written last. Fails if the packages are not available: the network is needed the first time.
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
