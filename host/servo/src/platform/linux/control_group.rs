//! Control groups (cgroups) of a process, and the folders of their files.

use std::path::{Path, PathBuf};

/// Control group of a process.
pub(super) struct Group {
    /// Controllers, or name of the hierarchy; empty for version 2.
    hierarchy: String,
    /// Path of the group in its hierarchy.
    pub(super) path: String,
    mount: Option<Mount>,
}

/// Parses the text of `/proc/PID/cgroup`; a group whose hierarchy is not among `mounts` has no folders.
pub(super) fn groups(file: &str, mounts: &[Mount]) -> Vec<Group> {
    let group = |line: &str| {
        let mut fields = line.splitn(3, ':').skip(1);
        let (hierarchy, path) = (fields.next()?.to_owned(), fields.next()?.to_owned());
        let mount = mounts.iter().find(|mount| mount.holds(&hierarchy)).cloned();
        Some(Group { hierarchy, path, mount })
    };
    file.lines().filter_map(group).collect()
}

impl Group {
    /// Returns true if the group belongs to this controller of version 1.
    pub(super) fn is_of(&self, controller: &str) -> bool {
        self.hierarchy.split(',').any(|own| own == controller)
    }

    /// Returns true for the root of a hierarchy, which is never killed as a group; false for the root of a container's own view.
    pub(super) fn is_root(&self) -> bool {
        self.path == "/" && self.mount.as_ref().is_none_or(Mount::is_whole)
    }

    pub(super) fn is_inside(&self, outer: &Self) -> bool {
        self.hierarchy == outer.hierarchy && Path::new(&self.path).starts_with(&outer.path)
    }

    /// Returns the mounted folders of the group and of all outer groups, innermost first; none if the group is not mounted.
    pub(super) fn folders(&self) -> Vec<PathBuf> {
        let Some(mount) = &self.mount else { return Vec::new() };
        let Ok(inner) = Path::new(&self.path).strip_prefix(&mount.root) else { return Vec::new() };
        inner.ancestors().map(|group| mount.folder.join(group)).collect()
    }
}

/// Mount point of a hierarchy of control groups.
#[derive(Clone)]
pub(super) struct Mount {
    /// Group that is mounted at the folder, as visible to this process.
    root: String,
    folder: PathBuf,
    /// Options of the mount, which include the controllers of version 1, as in [`Group::hierarchy`].
    options: Vec<String>,
    is_second_version: bool,
}

impl Mount {
    /// Parses a line of `/proc/self/mountinfo`; `None` for other file systems.
    pub(super) fn parse(line: &str) -> Option<Self> {
        let (mount, system) = line.split_once(" - ")?;
        let mut mount = mount.split(' ').skip(3);
        let (root, folder) = (mount.next()?.to_owned(), PathBuf::from(mount.next()?));
        let system: Vec<&str> = system.split(' ').collect();
        let is_second_version = match *system.first()? {
            "cgroup2" => true,
            "cgroup" => false,
            _ => return None,
        };
        let options = system.last()?.split(',').map(str::to_owned).collect();
        Some(Self { root, folder, options, is_second_version })
    }

    fn holds(&self, hierarchy: &str) -> bool {
        match hierarchy {
            "" => self.is_second_version,
            _ => {
                let mut controllers = hierarchy.split(',');
                !self.is_second_version
                    && controllers.all(|controller| self.options.iter().any(|option| option == controller))
            }
        }
    }

    /// Returns true if the folder is the root of the whole hierarchy: it has no `cgroup.events` in version 2, and the only
    /// `release_agent` in version 1.
    fn is_whole(&self) -> bool {
        match self.is_second_version {
            true => !self.folder.join("cgroup.events").exists(),
            false => self.folder.join("release_agent").exists(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MOUNTS: &str = "\
        30 24 0:26 / /sys/fs/cgroup/unified rw,relatime - cgroup2 cgroup2 rw,nsdelegate\n\
        31 24 0:27 / /sys/fs/cgroup/cpu,cpuacct rw,relatime shared:9 - cgroup cgroup rw,cpu,cpuacct\n\
        32 24 0:28 / /sys/fs/cgroup/systemd rw,relatime shared:9 - cgroup cgroup rw,name=systemd\n\
        33 24 0:29 / /sys/fs/cgroup/memory rw,relatime shared:9 - cgroup cgroup rw,memory\n\
        34 24 0:30 / / rw,relatime - ext4 /dev/sda1 rw\n";

    fn of(file: &str) -> Vec<Group> {
        let mounts: Vec<_> = MOUNTS.lines().filter_map(Mount::parse).collect();
        groups(file, &mounts)
    }

    #[test]
    fn each_group_is_found_where_its_hierarchy_is_mounted() {
        let found = of("3:name=systemd:/a.slice/b.scope\n2:cpu,cpuacct:/c\n0::/a.slice/b.scope\n");
        let folder = |group: &Group| group.mount.as_ref().map(|mount| mount.folder.display().to_string());
        let found: Vec<_> = found.iter().map(|group| (group.path.as_str(), folder(group))).collect();
        let folders = ["systemd", "cpu,cpuacct", "unified"].map(|name| format!("/sys/fs/cgroup/{name}"));
        let paths = ["/a.slice/b.scope", "/c", "/a.slice/b.scope"];
        assert_eq!(found, paths.into_iter().zip(folders.map(Some)).collect::<Vec<_>>());
    }

    #[test]
    fn outer_groups_follow_the_inner_one_up_to_the_mount() {
        let folders = of("0::/a.slice/b.scope\n")[0].folders();
        let expected = ["a.slice/b.scope", "a.slice", ""];
        assert_eq!(folders, expected.map(|group| PathBuf::from("/sys/fs/cgroup/unified").join(group)));
        assert!(of("5:pids:/a\n")[0].folders().is_empty(), "it is mounted nowhere");
    }

    #[test]
    fn a_group_inside_ends_with_its_outer_group_and_a_sibling_does_not() {
        let host = of("0::/a/b\n");
        for (own, is_inside) in
            [("0::/a/b", true), ("0::/a/b/c", true), ("0::/a/bc", false), ("0::/a", false)]
        {
            assert_eq!(of(own)[0].is_inside(&host[0]), is_inside, "{own}");
        }
        assert!(!of("2:cpu,cpuacct:/a/b\n")[0].is_inside(&host[0]), "another hierarchy");
    }
}
