#!/bin/sh
# SPDX-License-Identifier: GPL-3.0-or-later
# Blender's own window with the extension of dist/ installed, beside the user's own settings. Run by ./dev gui [FILE].
set -eu
cd "$(dirname "$0")/.."

blender=${BLENDER:-blender}
command -v "$blender" >/dev/null || {
    echo "no Blender found: install Blender 4.2 or later, or name one as BLENDER=/path/to/blender" >&2
    exit 1
}
case "$(uname -s)-$(uname -m)" in
Linux-x86_64) platform=linux_x64 ;;
Darwin-arm64) platform=macos_arm64 ;;
*) echo "the extension is built for Linux x64, Windows x64 and macOS arm64 only" >&2 && exit 1 ;;
esac

BLENDER_USER_RESOURCES="$PWD/build/gui"
export BLENDER_USER_RESOURCES
mkdir -p "$BLENDER_USER_RESOURCES"
"$blender" --command extension install-file --repo user_default --enable dist/virtual_light_mesh-*-"$platform".zip
# install-file ends with 0 when it fails, too
"$blender" --command extension list | grep -q virtual_light_mesh || {
    echo "Blender did not install the extension; its message is above" >&2
    exit 1
}
exec "$blender" "$@"
