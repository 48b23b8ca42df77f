//! The service manager that started this program, if one did.

use std::sync::OnceLock;

use relens::daemon::service::ServiceManager;

/// The service manager that started this program, if one did.
pub(super) fn service_manager() -> &'static ServiceManager {
    static MANAGER: OnceLock<ServiceManager> = OnceLock::new();
    MANAGER.get_or_init(|| ServiceManager::at(std::env::var_os("NOTIFY_SOCKET").as_deref()))
}
