#!/usr/bin/env bash
# Puts the headers of onnxruntime into a folder: from the package libonnxruntime-dev of Debian 13,
# which apt fetches and checks by its signature. Nothing is installed, no root is needed.
# usage: headers.sh [FOLDER]; default: include, beside this file
set -euo pipefail
folder="$(realpath -m "${1:-"$(dirname "$0")/include"}")"
keys=/usr/share/keyrings/debian-archive-keyring.gpg
if [[ -f "$folder/onnxruntime_c_api.h" ]]; then exit 0; fi
if ! command -v apt-get > /dev/null || [[ ! -f $keys ]]; then
  echo "headers.sh needs apt and debian-archive-keyring; take the release archive, see README.md" >&2
  exit 1
fi
work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT
mkdir -p "$work/lists/partial" "$work/cache/archives/partial"
mirror="$(apt-get indextargets --format '$(REPO_URI)' 'Created-By: Packages' | grep -m1 '/debian/*$')" ||
  { echo "headers.sh knows no mirror of Debian: apt has none; take the release archive, see README.md" >&2; exit 1; }
echo "deb [signed-by=$keys] $mirror trixie main" > "$work/sources.list"
apt="apt-get -q -o APT::Sandbox::User=$(id -un) -o Debug::NoLocking=1 -o Acquire::Languages=none
  -o Dir::Etc::SourceList=$work/sources.list -o Dir::Etc::SourceParts=/dev/null
  -o Dir::State::Lists=$work/lists -o Dir::Cache=$work/cache"
cd "$work"
$apt update > "$work/log" || { cat "$work/log" >&2; exit 1; }
$apt download libonnxruntime-dev > "$work/log" || { cat "$work/log" >&2; exit 1; }
dpkg-deb -x libonnxruntime-dev_*.deb unpacked
mkdir -p "$folder"
cp unpacked/usr/include/onnxruntime/onnxruntime_*.h unpacked/usr/share/doc/libonnxruntime-dev/copyright "$folder/"
