#!/usr/bin/env bash
# What `check --sarif` writes, by the rules of the SARIF multitool, those for GitHub's code scanning among them.
set -euo pipefail
cd "$(mktemp -d)" && trap 'rm -rf "$PWD"' EXIT
npm install --silent --no-audit --no-fund @microsoft/sarif-multitool@5.7.0 || exit 3

printf '@07\n@0Q\n' > job.txt
isel-twin check job.txt none.txt --plant kinematic --sarif check.sarif || [ $? = 1 ]
# its wrapper hands its words to a shell; its exit code is 0 whatever it finds
node_modules/.bin/sarif-multitool validate check.sarif --rule-kind "'Sarif;Ghas'" | tee told
grep --quiet 'Analysis completed successfully' told
! grep --quiet ': error ' told
