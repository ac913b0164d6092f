use super::*;
use std::fs::FileTimes;
use tempfile::TempDir;

const PLENTY: u64 = 1 << 20;

fn open(root: &TempDir, farm: &str, limit: u64) -> (Spool, Vec<Spooled>) {
    Spool::open(root.path(), farm, limit, SystemTime::now()).unwrap()
}

/// Ends a worker as SIGKILL does: the lock is free, the files stay.
fn kill(spool: Spool) -> PathBuf {
    let (folder, lock) = (spool.folder().to_owned(), spool.lock_path.clone());
    drop(spool);
    assert!(lock.exists() && folder.exists(), "it had something to leave");
    folder
}

fn files(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> = fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

fn is_empty(folder: &Path) -> bool {
    files(folder).is_empty()
}

#[test]
fn a_chunk_is_there_until_it_is_removed_and_the_folder_goes_with_its_owner() {
    let root = TempDir::new().unwrap();
    let (spool, inherited) = open(&root, "farm", PLENTY);
    assert!(inherited.is_empty());
    let token = Token::random();
    let spooled = spool.store(token, 3, b"segments").unwrap().unwrap();
    assert_eq!((spooled.token, spooled.number, spool.used()), (token, 3, 8));
    assert_eq!(spool.load(&spooled).unwrap(), &b"segments"[..]);
    spool.remove(&spooled);
    assert_eq!(spool.used(), 0);
    drop(spool);
    assert!(is_empty(root.path()), "nothing is left behind: {:?}", files(root.path()));
}

#[test]
fn the_next_worker_takes_over_what_a_killed_one_left_oldest_first() {
    let root = TempDir::new().unwrap();
    let (spool, _) = open(&root, "farm", PLENTY);
    let (first, second) = (Token::random(), Token::random());
    let now = SystemTime::now();
    for (k, (token, number)) in [(second, 0), (first, 1), (first, 0)].into_iter().enumerate() {
        let spooled = spool.store(token, number, &[k as u8; 100]).unwrap().unwrap();
        let written = now - Duration::from_secs(if token == first { 20 } else { 10 });
        File::options().write(true).open(&spooled.path).unwrap().set_times(FileTimes::new().set_modified(written)).unwrap();
    }
    let folder = kill(spool);
    let (heir, inherited) = open(&root, "farm", PLENTY);
    let order: Vec<(Token, u32)> = inherited.iter().map(|s| (s.token, s.number)).collect();
    assert_eq!(order, [(first, 0), (first, 1), (second, 0)]);
    assert_eq!(inherited.iter().map(|s| heir.load(s).unwrap()[0]).collect::<Vec<_>>(), [2, 1, 0]);
    assert_eq!(heir.used(), 300);
    assert!(!folder.exists(), "the old folder is gone");
    let (other, nothing) = open(&root, "farm", PLENTY);
    assert!(nothing.is_empty(), "the heir holds them now");
    inherited.iter().for_each(|s| heir.remove(s));
    drop((heir, other));
    assert!(is_empty(root.path()));
}

#[test]
fn a_folder_whose_owner_lives_is_left_alone() {
    let root = TempDir::new().unwrap();
    let (spool, _) = open(&root, "farm", PLENTY);
    let spooled = spool.store(Token::random(), 0, b"mine").unwrap().unwrap();
    let (_other, inherited) = open(&root, "farm", PLENTY);
    assert!(inherited.is_empty());
    assert_eq!(spool.load(&spooled).unwrap(), &b"mine"[..]);
}

#[test]
fn chunks_of_another_farm_are_never_taken_over() {
    let root = TempDir::new().unwrap();
    let (spool, _) = open(&root, "theirs", PLENTY);
    spool.store(Token::random(), 0, b"theirs").unwrap().unwrap();
    let folder = kill(spool);
    let (_ours, inherited) = open(&root, "ours", PLENTY);
    assert!(inherited.is_empty());
    assert_eq!(files(&folder).len(), 1);
    let (_theirs, inherited) = open(&root, "theirs", PLENTY);
    assert_eq!(inherited.len(), 1);
}

#[test]
fn what_a_crash_left_half_written_is_no_chunk() {
    let root = TempDir::new().unwrap();
    let (spool, _) = open(&root, "farm", PLENTY);
    // Between the write and the rename.
    let digest = Digest::of(b"half a chunk");
    let part = spool.folder().join(Spooled::name(Token::random(), 0, digest)).with_extension(&PART[1..]);
    fs::write(&part, b"half").unwrap();
    let folder = kill(spool);
    let (heir, inherited) = open(&root, "farm", PLENTY);
    assert!(inherited.is_empty() && !folder.exists());
    assert_eq!(heir.used(), 0);
}

#[test]
fn a_file_damaged_by_a_crash_of_the_machine_is_recognised() {
    let root = TempDir::new().unwrap();
    let (spool, _) = open(&root, "farm", PLENTY);
    let spooled = spool.store(Token::random(), 0, &[7; 64]).unwrap().unwrap();
    fs::write(&spooled.path, [0; 64]).unwrap();
    assert!(matches!(spool.load(&spooled), Err(SpoolError::Damaged { length: 64, .. })));
    spool.remove(&spooled);
    assert!(matches!(spool.load(&spooled), Err(SpoolError::Read { .. })));
}

#[test]
fn the_bound_holds_and_room_comes_back() {
    let root = TempDir::new().unwrap();
    let (spool, _) = open(&root, "farm", 100);
    let token = Token::random();
    let a = spool.store(token, 0, &[0; 60]).unwrap().unwrap();
    assert_eq!(spool.store(token, 1, &[1; 60]).unwrap(), None);
    let b = spool.store(token, 1, &[1; 40]).unwrap().unwrap();
    assert_eq!(spool.used(), 100);
    spool.remove(&a);
    let c = spool.store(token, 2, &[2; 60]).unwrap().unwrap();
    assert_eq!(spool.store(token, 3, &[3; 101]).unwrap(), None, "never above the bound, not even alone");
    spool.remove(&b);
    spool.remove(&c);
    assert_eq!(spool.used(), 0);
}

#[test]
fn a_disk_that_takes_nothing_is_an_error_that_leaves_no_trace() {
    let root = TempDir::new().unwrap();
    let (spool, _) = open(&root, "farm", PLENTY);
    let folder = spool.folder().to_owned();
    fs::remove_dir(&folder).unwrap();
    let error = spool.store(Token::random(), 0, b"bytes").unwrap_err();
    assert!(error.to_string().contains(folder.to_str().unwrap()), "{error}");
    assert_eq!(spool.used(), 0, "room that was not used is given back");
}

#[test]
fn what_lay_there_for_more_than_a_day_is_dropped_whoevers_it_was() {
    let root = TempDir::new().unwrap();
    let old = SystemTime::now() - OLDEST - Duration::from_secs(60);
    for farm in ["ours", "theirs"] {
        let (spool, _) = open(&root, farm, PLENTY);
        let stale = spool.store(Token::random(), 0, b"stale").unwrap().unwrap();
        File::options().write(true).open(&stale.path).unwrap().set_times(FileTimes::new().set_modified(old)).unwrap();
        spool.store(Token::random(), 1, b"fresh").unwrap().unwrap();
        kill(spool);
    }
    let (_ours, inherited) = open(&root, "ours", PLENTY);
    assert_eq!(inherited.iter().map(|s| s.number).collect::<Vec<_>>(), [1]);
    let (_theirs, inherited) = open(&root, "theirs", PLENTY);
    assert_eq!(inherited.iter().map(|s| s.number).collect::<Vec<_>>(), [1]);
}

#[test]
fn a_lock_file_that_was_left_alone_goes_after_a_day() {
    let root = TempDir::new().unwrap();
    let (spool, _) = open(&root, "farm", PLENTY);
    let home = spool.folder().parent().unwrap().to_owned();
    let (stale, young) = (home.join("stale.lock"), home.join("young.lock"));
    let old = SystemTime::now() - OLDEST - Duration::from_secs(60);
    File::create(&stale).unwrap().set_times(FileTimes::new().set_modified(old)).unwrap();
    File::create(&young).unwrap();
    open(&root, "farm", PLENTY);
    assert!(!stale.exists() && young.exists());
}

#[test]
fn workers_that_start_and_end_at_once_do_not_trip_over_each_other() {
    let root = TempDir::new().unwrap();
    std::thread::scope(|scope| {
        for _ in 0..8 {
            scope.spawn(|| {
                for number in 0..20 {
                    let (spool, inherited) = open(&root, "farm", PLENTY);
                    assert!(inherited.is_empty(), "everyone clears up");
                    let spooled = spool.store(Token::random(), number, b"bytes").unwrap().unwrap();
                    assert_eq!(spool.load(&spooled).unwrap(), &b"bytes"[..]);
                    spool.remove(&spooled);
                }
            });
        }
    });
    assert!(is_empty(root.path()), "{:?}", files(root.path()));
}
