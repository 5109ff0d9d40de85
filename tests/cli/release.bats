# SPDX-License-Identifier: GPL-2.0-or-later
# A release: its tarball, its data to try, its tag; where the project lives.

load cli

setup() {
	work_folder
}

# The project's make on this build, apart from the make that may be running this test.
project() {
	env -u MAKEFLAGS -u MFLAGS -u MAKELEVEL -u DESTDIR -u LD_LIBRARY_PATH \
		make --no-print-directory -C "$root" O="$INCISE_BUILD" "$@"
}

# A clone of what is committed, on a branch of its own, ready for a release.
scratch_clone() {
	git -C "$root" rev-parse -q --verify HEAD >/dev/null 2>&1 ||
		skip "the source is no git repository with a commit"
	git clone -q --no-hardlinks "$root" clone
	cd clone
	git switch -q -c release
	git config user.name tests
	git config user.email tests@incise.invalid
	# Scripts as they are now.
	cp "$root"/mk/{release,release.mk,dist,parts,project,project.mk} mk
	version=$(sed -n 's/.*INCISE_VERSION "\(.*\)"/\1/p' lib/include/incise/version.h)
	printf '# Changelog\n\n## [Unreleased]\n\n## [%s] - 2026-12-01\n\n- Something.\n' "$version" >CHANGELOG.md
	sed -i "s/^version: .*/version: $version/" CITATION.cff
	sed -i "1s/(.*)/($version)/" debian/changelog
	git commit -q -a -m "release" || :
}

# A refusal that names its reason, and no tag.
refuses() { # WORDS [MAKE-VARIABLE…]
	local words=$1
	shift
	run ! --separate-stderr env -u MAKEFLAGS -u MFLAGS -u MAKELEVEL make -s release "$@"
	[[ "$stderr" == *"make release: "*"$words"* ]] || complain "$words: $stderr"
	[ -z "$(git tag -l)" ] || complain "tagged: $words"
}

@test "release refuses what is not ready, says what it would do, and tags what passed" {
	scratch_clone
	echo >>README.md
	refuses "README.md: not committed"
	git checkout -q README.md
	git switch -q --detach
	refuses "HEAD is on no branch"
	git switch -q release
	sed -i 's/^## \[Unreleased\]/&\n\n- New./' CHANGELOG.md
	git commit -q -a -m new
	refuses "Unreleased has entries; move them to $version: - New."
	sed -i "/^- New/d; s/^## \[$version\].*/## [$version]/" CHANGELOG.md
	git commit -q -a -m undated
	refuses "no section '## [$version] - DATE'"
	sed -i "s/^## \[$version\]/& - 2026-12-01/" CHANGELOG.md
	sed -i 's/^version: .*/version: 0.0.9/' CITATION.cff
	git commit -q -a -m dated
	refuses "CITATION.cff: has version 0.0.9, the source $version"
	sed -i "s/^version: .*/version: $version/" CITATION.cff
	git commit -q -a -m cited

	run -0 env -u MAKEFLAGS -u MFLAGS -u MAKELEVEL make -s release DRY=yes
	grep -q "^would run: .* check$" <<<"$output"
	grep -q "^would run: .* dist$" <<<"$output"
	grep -q "^would run: git tag .* v$version    # on release$" <<<"$output"
	[ -z "$(git tag -l)" ]

	refuses "no-such-target failed; nothing is tagged" CHECK=no-such-target
	# dist has a test of its own; here it is another target that passes
	printf 'dist passes:\n\t@:\n' >passing.mk
	echo passing.mk >>.git/info/exclude
	run -0 env MAKE="make -f passing.mk" mk/release "$version" passes
	[ "$(git tag -l)" = "v$version" ]
	[ "$(git cat-file -t "v$version")" = tag ]
	[[ "$output" == *"to publish it: git push REMOTE release v$version"* ]]
	run -1 --separate-stderr mk/release "$version" passes
	[[ "$stderr" == "make release: v$version is tagged already"* ]]

	# Outside of git, whatever repository this folder is in.
	rm -rf .git
	export GIT_CEILING_DIRECTORIES=$PWD/..
	for script in "mk/dist out $version example" "mk/release $version passes"; do
		run -1 --separate-stderr bash -c "$script"
		[[ "$stderr" == "make "*"no git repository with a commit here; run it in a clone"* ]] || complain "$stderr"
	done
}

@test "dist makes a tarball of the source with data, parts and checksums, the same bytes twice" {
	git -C "$root" rev-parse -q --verify HEAD >/dev/null 2>&1 ||
		skip "the source is no git repository with a commit"
	version=$(incise info --version | cut -d' ' -f2)
	here=$PWD
	for name in first second; do
		project -s example-data
		(cd "$root" && PROJECT_HOME=https://incise.invalid/ mk/dist "$here/$name" "$version" "$INCISE_BUILD/example")
	done
	cmp first/SHA256SUMS second/SHA256SUMS
	(cd first && sha256sum -c SHA256SUMS)
	tar xf "first/incise-$version.tar.gz"
	for file in README.md Makefile lib/include/incise/version.h man/incise.1 doc/parts.md example/README.md; do
		[ -s "incise-$version/$file" ] || complain "$file is not in it"
	done
	[ "$(ls)" = "$(printf '%s\n' first "incise-$version" second)" ]
	grep -qE '^\| libconfig-dev \| library \| LGPL-2.1-or-later \|$' first/parts.md
	grep -qx "PROJECT_HOME ?= https://incise.invalid/" "incise-$version/mk/project.mk"
	cd "incise-$version/example"
	[ "$(du -sk . | cut -f1)" -le 5120 ]
	[ "$(wc -l <README.md)" -le 12 ]
	incise verify liver.rec
	echo '5 20' | incise eval liver.fis
	incise assess expert.session | grep -qx "9 of 9 criteria met"
}

@test "every package that incise is built of has its licence" {
	awk '!/^#/ && / build( |$)/ { print $1; exit }' "$root/mk/packages" >first
	grep -v "^$(cat first) " "$root/mk/licences" >licences
	run -1 --separate-stderr "$root/mk/parts" licences "$root/mk/packages"
	[ "$stderr" = "mk/parts: $(cat first): no licence; add a line to mk/licences" ]
	run -0 "$root/mk/parts" "$root/mk/licences" "$root/mk/packages"
}

# bats test_tags=check
@test "where the project lives is stated in mk/project.mk alone, and left out while it is empty" {
	home=https://incise.invalid/home tracker=https://incise.invalid/faults contact=people@incise.invalid
	if ! grep -qE '^PROJECT_[A-Z]+ \?= *[^ ]' "$root/mk/project.mk"; then
		run ! grep -q "^Home page:" <(incise --help)
		run ! grep -q "^.Sh PROJECT" "$INCISE_BUILD/man/incise.1"
	fi
	unset PROJECT_HOME PROJECT_TRACKER PROJECT_CONTACT
	for file in debian/control CITATION.cff mk/project.mk; do
		(cd "$root" && mk/project "$file") | cmp - "$root/$file"
	done
	[ -z "$("$root/mk/project" help)" ]

	export PROJECT_HOME=$home PROJECT_TRACKER=$tracker PROJECT_CONTACT=$contact
	cd "$root"
	[ "$(mk/project help)" = "#define PROJECT \"Home page: $home\nReport faults: $tracker\nContact: $contact\n\"" ]
	mk/project debian/control >"$BATS_TEST_TMPDIR/control"
	grep -qx "Homepage: $home" "$BATS_TEST_TMPDIR/control"
	grep -qx "Maintainer: incise maintainers <$contact>" "$BATS_TEST_TMPDIR/control"
	mk/project CITATION.cff | grep -qx "url: $home"
	mk/project mk/project.mk | grep -qx "PROJECT_TRACKER ?= $tracker"
	mk/manual-output <man/incise.1 | grep -qx ".Lk $home"
	mk/manual-output <man/incise.1 | grep -qx ".Mt $contact"
	python3 -c 'import ast, os, re
source = ast.parse(open("setup.py").read())
part = [node for node in source.body if isinstance(node, ast.FunctionDef) and node.name == "project_urls"]
scope = {"os": os, "re": re}
exec(compile(ast.Module(part, []), "setup.py", "exec"), scope)
print(scope["project_urls"]())' >"$BATS_TEST_TMPDIR/urls"
	grep -qF "{'Homepage': '$home', 'Tracker': '$tracker', 'Contact': 'mailto:$contact'}" "$BATS_TEST_TMPDIR/urls"
	# The program of such a build, from a compiler's own view.
	mk/project help >"$BATS_TEST_TMPDIR/project.h"
	${CC:-cc} -E -Ilib/include -Itools -include "$BATS_TEST_TMPDIR/project.h" -D_GNU_SOURCE tools/incise.c |
		grep -qF "printf(\"\n%s\", \"Home page: $home"
	PROJECT_HOME="a b" run -1 --separate-stderr mk/project help
	[ "$stderr" = "mk/project: a b is no address; give one without blanks and quotes" ]
}
