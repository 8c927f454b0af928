#!/usr/bin/env bash
# Installs what this machine lacks, with apt-get; does nothing and says nothing where nothing is missing.
# usage: scripts/setup.sh PURPOSE...   a purpose is build, run, test, lint or python
set -euo pipefail

# The one list of what mends what: purpose, Debian package, check, reason.
# A check looks for files, not for packages, so that another way of having them does as well.
readonly NEEDS='
build  g++                      has_linker       cc, crt1.o and libstdc++, with which every program here is linked
build  libshaderc-dev           has_shaderc      shaderc, which compiles the shaders to SPIR-V during the build
build  glslang-dev              has_glslang      the GLSL front end, which the libshaderc of Debian does not contain
build  spirv-tools              has_spirv_tools  the SPIR-V optimizer, which the libshaderc of Debian does not contain
run    libvulkan1               has_loader       the Vulkan loader
run    mesa-vulkan-drivers      has_driver       a Vulkan driver for the CPU and for GPUs, as there is none yet
test   vulkan-validationlayers  has_validation   the validation layer, under which the tests run
test   libegl1                  has_egl          EGL, which opens OpenGL without a window for `cousu compare`
test   libgl1-mesa-dri          has_opengl       an OpenGL driver for the CPU and for GPUs, as there is none yet
python python3-venv             has_venv         environments of Python, into one of which Mitsuba is installed
'

main() {
    has cargo || fail "cargo is not on the PATH: install Rust with rustup, or open a new shell if you just have."
    local packages=() reasons=() checks=() wanted=" $* " purpose package check reason
    while read -r purpose package check reason; do
        if [[ -n $purpose && $wanted == *" $purpose "* ]] && ! $check; then
            packages+=("$package") checks+=("$check") reasons+=("$package: $reason")
        fi
    done <<<"$NEEDS"
    if ((${#packages[@]})); then
        install_packages
    fi
    if [[ $wanted == *" lint "* ]]; then
        has_component fmt || fail "cargo fmt is missing: run \`rustup component add rustfmt\`."
        has_component clippy || fail "cargo clippy is missing: run \`rustup component add clippy\`."
    fi
}

# Reads `packages`, `reasons` and `checks` of main.
install_packages() {
    local names
    names=$(printf ', %s' "${packages[@]}")
    names=${names#, }
    has apt-get || fail "There is no apt-get here: install what Debian calls $names."
    local as_root=()
    if ((EUID != 0)); then
        has sudo || fail "This needs root or sudo: have root run \`apt-get install ${packages[*]}\`."
        as_root=(sudo)
    fi
    printf 'installing %s\n' "${reasons[@]}"
    log=$(mktemp)
    trap 'rm -f "$log"' EXIT
    # The lists can be absent or old. One unreachable source need not matter, so install has the last word.
    if ! "${as_root[@]}" sh -c '
        export DEBIAN_FRONTEND=noninteractive
        apt-get -o DPkg::Lock::Timeout=300 update
        apt-get -o DPkg::Lock::Timeout=300 install -y --no-install-recommends "$@"
    ' sh "${packages[@]}" </dev/null >"$log" 2>&1; then
        cat "$log" >&2
        fail "Installing $names failed: see above."
    fi
    local i
    for i in "${!packages[@]}"; do
        ${checks[i]} || fail "${packages[i]} is installed, but it did not bring what was missing (${reasons[i]#*: })."
    done
}

has_linker() {
    found_by_cc crt1.o && { found_by_cc libstdc++.so || found_by_cc libstdc++.a; }
}

has_shaderc() {
    own_shaderc || has_library libshaderc_combined.a || has_library libshaderc.so || pkg-config --exists shaderc 2>/dev/null
}

# Elsewhere than on Debian and its kin, libshaderc is whole (see crates/shaderc-link).
has_glslang() {
    own_shaderc || [[ ! -e /etc/debian_version ]] || has_library libglslang.a
}

has_spirv_tools() {
    own_shaderc || [[ ! -e /etc/debian_version ]] || has_library libSPIRV-Tools-opt.a
}

has_loader() {
    has_library libvulkan.so.1
}

# A manifest whose library is missing is no driver.
has_driver() {
    [[ -z ${VK_DRIVER_FILES-}${VK_ICD_FILENAMES-} ]] || return 0
    local manifest library
    while read -r manifest; do
        library=$(sed -n 's/.*"library_path"[^"]*"\([^"]*\)".*/\1/p' "$manifest")
        case $library in
            /*) [[ ! -e $library ]] || return 0 ;;
            */*) [[ ! -e ${manifest%/*}/$library ]] || return 0 ;;
            ?*) ! has_library "$library" || return 0 ;;
        esac
    done < <(vulkan_manifests icd.d '*.json')
    return 1
}

has_validation() {
    [[ -n $(vulkan_manifests explicit_layer.d VkLayer_khronos_validation.json) ]]
}

has_egl() {
    has_library libEGL.so.1
}

# A vendor's own driver brings its manifest for the vendor-neutral EGL; Mesa's needs its DRI modules too.
has_opengl() {
    [[ -z ${__EGL_VENDOR_LIBRARY_FILENAMES-} ]] || return 0
    local manifest
    for manifest in /usr/share/glvnd/egl_vendor.d/*.json /etc/glvnd/egl_vendor.d/*.json; do
        [[ ! -e $manifest || $manifest == *mesa* ]] || return 0
    done
    has_library libEGL_mesa.so.0 && [[ -n $(find /usr/lib -name swrast_dri.so -o -name 'libgallium*' 2>/dev/null) ]]
}

has_venv() {
    python3 -c 'import venv, ensurepip' 2>/dev/null
}

has() {
    command -v "$1" >/dev/null
}

has_component() {
    cargo "$1" --version >/dev/null 2>&1
}

# The builder has named a libshaderc of their own.
own_shaderc() {
    [[ -n ${SHADERC_LIB_DIR-}${VULKAN_SDK-} ]]
}

# cc answers with the bare name where it does not find the file.
found_by_cc() {
    [[ $(cc -print-file-name="$1" 2>/dev/null) == */* ]]
}

has_library() {
    local folder own_folders=${LD_LIBRARY_PATH-}
    for folder in "/usr/lib/$(uname -m)-linux-gnu" /usr/lib64 /usr/lib /usr/local/lib ${own_folders//:/ }; do
        [[ ! -e $folder/$1 ]] || return 0
    done
    [[ $(PATH=$PATH:/sbin ldconfig -p 2>/dev/null) == *[[:space:]]"$1"[[:space:]]* ]]
}

# Prints the files of that name pattern where the Vulkan loader looks for them.
vulkan_manifests() {
    local roots=/etc:/usr/local/etc:${XDG_CONFIG_DIRS:-/etc/xdg}:${XDG_CONFIG_HOME:-${HOME-}/.config}
    roots+=:${XDG_DATA_DIRS:-/usr/local/share:/usr/share}:${XDG_DATA_HOME:-${HOME-}/.local/share}
    local root folders=()
    while read -rd : root; do
        folders+=("$root/vulkan/$1")
    done <<<"$roots:"
    if [[ $1 == explicit_layer.d && -n ${VK_LAYER_PATH-} ]]; then
        folders=("$VK_LAYER_PATH")
    fi
    find "${folders[@]}" -maxdepth 1 -name "$2" 2>/dev/null || true
}

fail() {
    echo "$1" >&2
    exit 1
}

main "$@"
